"""The observed geometry M_obs = (P_obs, A_obs): points of the room that captures support. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ...core.errors import GeometryError

FARTHEST_M = 1e6
"""Of a surface from the origin, or from its camera: no room is larger."""

LONGEST_UNIT = 1.001
"""A unit vector's longest component, as it is rounded."""

_KINDS = ("measured", "estimated")


@dataclass(frozen=True)
class ObservedGeometry:
    """Points of the room's surface that captures support, in the world frame.

    ``points`` (P, 3) float32 metres; ``normals`` (P, 3) float32 unit, towards the free
    side; ``colours`` (P, 3) float32 in [0, 1]; ``visibility`` (P, N) bool, A_obs: the
    captures that see the point; ``confidence`` (P,) float32 in [0, 1]; ``measured`` (P,) bool,
    whether its depth is a sensor's; ``estimated`` (P,) bool, whether it is an estimator's, of a capture that
    shares next to nothing with others.
    """

    points: np.ndarray
    normals: np.ndarray
    colours: np.ndarray
    visibility: np.ndarray
    confidence: np.ndarray
    measured: np.ndarray = None  # type: ignore[assignment]  # until it is made
    estimated: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in _KINDS:
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.zeros(len(self.points), bool))

    @staticmethod
    def none(captures: int) -> ObservedGeometry:
        """No point, of so many captures that support none."""
        nothing = np.zeros((0, 3), np.float32)
        return ObservedGeometry(nothing, nothing, nothing, np.zeros((0, captures), bool), np.zeros(0, np.float32))

    def joined(self, other: ObservedGeometry) -> ObservedGeometry:
        """These points, then the others."""
        return ObservedGeometry(
            *(
                np.concatenate([own := getattr(self, field.name), getattr(other, field.name).astype(own.dtype)])
                for field in fields(self)
            )
        )

    def save(self, path: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``; where nothing is of a kind, that says nothing of it."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        save_arrays(path, **{name: held for name, held in arrays.items() if name not in _KINDS or held.any()})

    @staticmethod
    def load(path: Path) -> ObservedGeometry:
        """Read what ``save`` wrote. Raises GeometryError when the file is none of it."""
        with opened_arrays(path, GeometryError, "this is not observed geometry") as data:
            names = [field.name for field in fields(ObservedGeometry)]
            arrays = {name: data[name] for name in names if name not in _KINDS or name in data}
            require_shapes(arrays, points="P 3", normals="P 3", colours="P 3", visibility="P N", confidence="P")
            require_between(-FARTHEST_M, FARTHEST_M, points=arrays["points"])
            require_between(-LONGEST_UNIT, LONGEST_UNIT, normals=arrays["normals"])
            require_between(0.0, 1.0, colours=arrays["colours"], confidence=arrays["confidence"])
            if arrays["visibility"].dtype != np.bool_:
                raise ValueError("visibility is not yes or no")
            observed = ObservedGeometry(**arrays)
            require_shapes(vars(observed), points="P 3", **dict.fromkeys(_KINDS, "P"))
            for name in _KINDS:
                if getattr(observed, name).dtype != np.bool_:
                    raise ValueError(f"{name} is not yes or no")
            return observed


OBSERVED = Artifact(layout.OBSERVED, ObservedGeometry.load, ObservedGeometry.save)
"""M_obs with its support record."""
