"""A person's picks in Blender's properties as the library's ``Picks``, and their residuals. No bpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...captures.frame.picks import CameraHeight, Pick, PickedLength, PickedPoint, Picks
from ...captures.frame.picks_fit import PicksFit, fit_picks
from ...captures.registered_views import RegisteredView
from ...captures.sparse_points import SPARSE
from ...core.errors import CaptureError, R2SEgoError
from ...core.progress import Progress
from .bundle import Bundle


def picks_of(group: Any) -> Picks:
    """The picks in the properties of ``R2SEGO_PG_captures``; points picked nowhere are left out."""
    points = tuple(
        PickedPoint(point.name, tuple(Pick(view.capture, view.x_px, view.y_px) for view in point.views), point.floor)
        for point in group.points
        if len(point.views)
    )
    lengths = tuple(PickedLength(one.start, one.end, one.metres) for one in group.lengths)
    heights: tuple[CameraHeight, ...] = ()
    if group.use_camera_height:
        heights = (CameraHeight(group.height_capture, group.camera_height),)
    return Picks(points, lengths, heights)


@dataclass(frozen=True)
class PlacedPick:
    """Where a picked point lies, metres, and by how much it misses: its picks in their order, and the
    farthest, in pixels, -1 where that is not known; a floor point by its height above the floor."""

    position: tuple[float, float, float]
    off_each_px: tuple[float, ...]
    off_floor_m: float = 0.0

    @property
    def off_px(self) -> float:
        """By how much the farthest of its picks misses."""
        return max(self.off_each_px)


@dataclass(frozen=True)
class PickFacts:
    """What picks come to: the points that could be placed by their names, the errors of known lengths by
    their ends, and of a known height. What cannot be told yet is said in ``fit_problem``."""

    placed: Mapping[str, PlacedPick] = field(default_factory=dict)
    lengths_m: Mapping[tuple[str, str], float] = field(default_factory=dict)
    height_error_m: float = 0.0
    fit_problem: str = ""
    fit_said: str = ""
    fit_warning: str = ""


def fit_of(picks: Picks, bundle: Bundle) -> PickFacts:
    """Where the picked points lie, their residuals and what they would correct."""
    if not (picks.points or picks.heights):
        return PickFacts()
    told, problem = _Warnings(), ""
    captures, sparse = bundle.captures(), _sparse(bundle)
    try:
        fit = fit_picks(picks, captures, sparse, told)
    except R2SEgoError as error:
        return _points_alone(picks, captures, sparse, str(error))
    try:
        fit.check()
    except CaptureError as error:
        problem = str(error)
    placed = _placed(fit)
    floor = [one.point.name for one in fit.placed if one.point.floor]
    for name, off_m in zip(floor, fit.floor_m, strict=True):
        placed[name] = replace(placed[name], off_floor_m=float(off_m))
    ends = [(one.start, one.end) for one in picks.lengths]
    lengths_m = dict(zip(ends, map(float, fit.length_m), strict=True))
    return PickFacts(
        placed,
        lengths_m,
        next(map(float, fit.height_m), 0.0),
        problem,
        "; ".join(_corrections(fit)),
        "; ".join(told.warnings),
    )


def _points_alone(picks: Picks, captures: Sequence[RegisteredView], sparse: Any, problem: str) -> PickFacts:
    """Residuals of single points, where the whole makes no floor or scale yet."""
    placed: dict[str, PlacedPick] = {}
    for point in picks.points:
        alone = Picks((PickedPoint(point.name, point.views),))
        try:
            placed |= _placed(fit_picks(alone, captures, sparse))
        except R2SEgoError as error:
            problem = str(error)
    return PickFacts(placed, fit_problem=problem)


def _placed(fit: PicksFit) -> dict[str, PlacedPick]:
    return {
        one.point.name: PlacedPick(
            tuple(one.position.tolist()), tuple(float(off) for off in np.where(np.isnan(one.off_px), -1.0, one.off_px))
        )
        for one in fit.placed
    }


def _corrections(fit: PicksFit) -> list[str]:
    """What applying the fit would change, in words."""
    said = []
    if fit.ground is not None:
        tilt_deg = np.degrees(np.arccos(np.clip(fit.ground.normal[2], -1.0, 1.0)))
        said.append(f"up turns by {tilt_deg:.2f} degrees, the floor lies at {fit.ground.offset:+.3f} m")
    if fit.metres_per_unit is not None:
        said.append(f"a metre becomes {fit.metres_per_unit:.4g} m")
    return said


class _Warnings(Progress):
    def __init__(self) -> None:
        self.warnings: list[str] = []

    def message(self, text: str, level: str = "info") -> None:
        """Keep what the person should know."""
        if level == "warning":
            self.warnings.append(text)


def _sparse(bundle: Bundle) -> Any:
    """Points and visibility alone; none at all where the bundle has no sparse points."""
    file = bundle.sparse_file
    if not file.is_file():
        return SimpleNamespace(points=np.empty((0, 3)), visibility=np.empty((0, len(bundle.captures())), bool))
    return bundle.read(SPARSE)
