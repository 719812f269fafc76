"""The slot of the depth estimator: captures and sparse points in, depth of each capture out.

A backend is a file of this folder with ``BACKENDS``, its names (``config.slots``), and a class ``Estimator``;
nothing else has to know of it.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, cast

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...config.slots import ESTIMATORS
from .estimated_depth import EstimatedDepth


class DepthEstimator(Protocol):
    """What estimates depth of captures; ``label`` is what the bundle calls it, of a model what it told of itself."""

    label: str

    def estimate(self, captures: Sequence[Capture], sparse: SparsePoints) -> Mapping[str, EstimatedDepth]:
        """The depth of those captures that it knows, by their names.

        Captures have their cameras, in the world's metres as ``sparse``. Raises R2SEgoError where it cannot.
        """
        ...


def depth_estimator(name: str, **given: Any) -> DepthEstimator:
    """The estimator that the slot calls ``name``, made with what its class takes: a model's the name again."""
    module = importlib.import_module(f".{ESTIMATORS.module(name)}", __package__)
    return cast(DepthEstimator, module.Estimator(**given))
