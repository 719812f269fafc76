"""A person's picks in Blender's properties: to the library's ``Picks``, and their residuals back. No bpy."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from ...captures.frame.picks import CameraHeight, Pick, PickedLength, PickedPoint, Picks
from ...captures.frame.picks_fit import PicksFit, fit_picks
from ...core.arrays import opened_arrays
from ...core.errors import CaptureError, R2SEgoError, SceneError
from ...core.progress import Progress
from .bundle import Bundle


def picks_of(group: Any) -> Picks:
    """The picks in the properties of ``R2SEGO_PG_captures``; points picked nowhere are left out."""
    points = tuple(
        PickedPoint(
            point.name, tuple(Pick(view.capture, view.x_px, view.y_px) for view in point.views), point.floor
        )
        for point in group.points
        if len(point.views)
    )
    lengths = tuple(PickedLength(one.start, one.end, one.metres) for one in group.lengths)
    heights: tuple[CameraHeight, ...] = ()
    if group.use_camera_height:
        heights = (CameraHeight(group.height_capture, group.camera_height),)
    return Picks(points, lengths, heights)


def show_fit(group: Any, bundle: Bundle) -> None:
    """Write where the picked points lie, their residuals and what they would correct into the properties.

    What cannot be told yet is said in ``fit_problem``; nothing is raised.
    """
    for point in group.points:
        point.located, point.off_px, point.off_floor_m = False, -1.0, 0.0
        for view in point.views:
            view.off_px = -1.0
    for length in group.lengths:
        length.error_m, length.found = 0.0, False
    group.height_error_m = 0.0
    group.fit_problem = group.fit_said = group.fit_warning = ""
    picks = picks_of(group)
    if not (picks.points or picks.heights):
        return
    told = _Warnings()
    try:
        fit = fit_picks(picks, bundle.captures(), _sparse(bundle), told)
    except R2SEgoError as error:
        group.fit_problem = str(error)
        _show_points_alone(group, picks, bundle)
        return
    _show_points(group, fit)
    _show_errors(group, fit)
    try:
        fit.check()
    except CaptureError as error:
        group.fit_problem = str(error)
    group.fit_said, group.fit_warning = "; ".join(_corrections(fit)), "; ".join(told.warnings)


def _show_points_alone(group: Any, picks: Picks, bundle: Bundle) -> None:
    """Residuals of single points, where the whole makes no floor or scale yet."""
    captures, sparse = bundle.captures(), _sparse(bundle)
    for point in picks.points:
        alone = Picks((PickedPoint(point.name, point.views),))
        try:
            _show_points(group, fit_picks(alone, captures, sparse))
        except R2SEgoError as error:
            group.fit_problem = str(error)


def _show_points(group: Any, fit: PicksFit) -> None:
    shown = {point.name: point for point in group.points}
    for placed in fit.placed:
        point = shown[placed.point.name]
        point.located, point.position = True, placed.position.tolist()
        off_px = np.where(np.isnan(placed.off_px), -1.0, placed.off_px)
        point.off_px = float(off_px.max())
        for view, off in zip(point.views, off_px, strict=True):
            view.off_px = float(off)


def _show_errors(group: Any, fit: PicksFit) -> None:
    on_floor = [placed.point.name for placed in fit.placed if placed.point.floor]
    off_floor_m = dict(zip(on_floor, fit.floor_m, strict=True))
    for point in group.points:
        point.off_floor_m = float(off_floor_m.get(point.name, 0.0))
    for length, error_m in zip(group.lengths, fit.length_m, strict=True):
        length.error_m, length.found = float(error_m), True
    for error_m in fit.height_m:
        group.height_error_m = float(error_m)


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
        return SimpleNamespace(
            points=np.empty((0, 3)), visibility=np.empty((0, len(bundle.captures())), bool)
        )
    with opened_arrays(file, SceneError, "it cannot be read", "Import the captures again.") as data:
        return SimpleNamespace(points=data["points"], visibility=data["visibility"])
