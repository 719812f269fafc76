"""The consumers that there are: every file of this folder that has a ``CONSUMER``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from . import __path__
from .consumer import Consumer

_FILES = [importlib.import_module(f".{file.name}", __package__) for file in pkgutil.iter_modules(__path__)]
CONSUMERS: Mapping[str, Consumer] = MappingProxyType(
    {file.CONSUMER.name: file.CONSUMER for file in _FILES if hasattr(file, "CONSUMER")}
)
"""By the word after ``--for``."""
