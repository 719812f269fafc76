"""Points that a person picked in photographs, and what was measured between them. NumPy alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CaptureError
from ...core.json_files import finite_number, read_json

WHERE = "picks"
"""What errors call picks that stand in no file."""

_CURE = "Write it with Blender's Captures panel, or as docs/formats.md says."


@dataclass(frozen=True)
class Pick:
    """A point's pixel in the image of a capture in the bundle, from its upper left corner."""

    capture: str
    x_px: float
    y_px: float


@dataclass(frozen=True)
class PickedPoint:
    """One point of the room as it was picked in one or more captures."""

    name: str
    views: tuple[Pick, ...]
    floor: bool = False


@dataclass(frozen=True)
class PickedLength:
    """Two picked points, by name, are this far apart."""

    start: str
    end: str
    metres: float


@dataclass(frozen=True)
class CameraHeight:
    """A capture was taken this high above the floor."""

    capture: str
    metres: float


@dataclass(frozen=True)
class Picks:
    """Everything a person picked and measured."""

    points: tuple[PickedPoint, ...] = ()
    lengths: tuple[PickedLength, ...] = ()
    heights: tuple[CameraHeight, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """A JSON-ready dict; ``from_json`` reads it back."""
        points = [
            {
                "name": point.name,
                "floor": point.floor,
                "views": [{"capture": v.capture, "x_px": v.x_px, "y_px": v.y_px} for v in point.views],
            }
            for point in self.points
        ]
        lengths = [{"from": one.start, "to": one.end, "metres": one.metres} for one in self.lengths]
        heights = [{"capture": one.capture, "metres": one.metres} for one in self.heights]
        return {"points": points, "lengths": lengths, "camera_heights": heights}

    @staticmethod
    def from_json(data: Mapping[str, Any], where: str | Path = WHERE) -> Picks:
        """The picks of ``to_json``. Raises CaptureError that names what is wrong."""
        try:
            picks = Picks(
                tuple(
                    PickedPoint(
                        str(point["name"]),
                        tuple(
                            Pick(str(v["capture"]), finite_number(v["x_px"]), finite_number(v["y_px"]))
                            for v in point["views"]
                        ),
                        _whether(point.get("floor", False)),
                    )
                    for point in data.get("points", ())
                ),
                tuple(
                    PickedLength(str(one["from"]), str(one["to"]), finite_number(one["metres"]))
                    for one in data.get("lengths", ())
                ),
                tuple(
                    CameraHeight(str(one["capture"]), finite_number(one["metres"]))
                    for one in data.get("camera_heights", ())
                ),
            )
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            raise CaptureError(f"the field {error} is missing or wrong", where=where, cure=_CURE) from error
        picks.check(where)
        return picks

    @staticmethod
    def load(file: Path) -> Picks:
        """Read a JSON file. Raises CaptureError when it is missing or none."""
        try:
            data = read_json(file)
        except (OSError, ValueError) as error:
            raise CaptureError(f"the picks cannot be read: {error}", where=file, cure=_CURE) from error
        return Picks.from_json(data, file)

    def check(self, where: str | Path = WHERE) -> None:
        """Raise CaptureError for names used twice or never picked, and for lengths that are none."""
        names = [point.name for point in self.points]
        for name, count in Counter(names).items():
            if count > 1:
                raise CaptureError(f"two points are called '{name}'", where=where, cure="Rename one.")
        for point in self.points:
            seen_by = [view.capture for view in point.views]
            if len(set(seen_by)) < len(seen_by) or not seen_by:
                raise CaptureError(
                    f"point '{point.name}' is picked {'twice in one capture' if seen_by else 'nowhere'}",
                    where=where,
                    cure="Pick it once in each photograph that shows it.",
                )
        known = set(names)
        for one in self.lengths:
            if one.start == one.end or not {one.start, one.end} <= known:
                raise CaptureError(
                    f"a length goes from '{one.start}' to '{one.end}'",
                    where=where,
                    cure=f"Name two of the points {', '.join(names) or '(none is picked)'}.",
                )
        for metres in [*(one.metres for one in self.lengths), *(one.metres for one in self.heights)]:
            if not (np.isfinite(metres) and metres > 0):
                raise CaptureError(f"{metres} is no length in metres", where=where, cure="Give a positive one.")


def _whether(value: Any) -> bool:
    if not isinstance(value, bool):  # a text "false" would count as true
        raise ValueError(f"'floor' of {value!r}")
    return value
