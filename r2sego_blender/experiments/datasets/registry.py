"""Data sets by name, each a file in ``sets``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

from ...config.declared_files import did_you_mean
from ...core.errors import ExperimentError
from . import sets
from .dataset import Dataset


def _records() -> Mapping[str, Dataset]:
    modules = [module.name for module in pkgutil.iter_modules(sets.__path__)]
    found = [importlib.import_module(f".{name}", sets.__name__).DATASET for name in modules]
    return {one.name: one for one in sorted(found, key=lambda one: one.name)}


DATASETS = _records()
"""Every data set by its name."""


def dataset(name: str) -> Dataset:
    """The data set of a name. Raises ExperimentError."""
    if name not in DATASETS:
        cure = did_you_mean(name, DATASETS, f"Known: {', '.join(DATASETS)}.")
        raise ExperimentError(f"there is no data set '{name}'", where="--data", cure=cure)
    return DATASETS[name]
