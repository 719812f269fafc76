"""Registration of the captures to the world frame W: gravity, floor, origin, heading, scale.

The paper's fixed registration that maps captures and initial asset into the simulator's
world (Sec. "Problem Setting and Output"). It is solved once and applied to everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...config.settings import CaptureSettings
from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from ..capture import Capture
from ..importing import Imported
from ..sparse import USUAL_DEPTH_M, usual_depth
from ..sparse_points import SparsePoints
from .depth_scale import depth_scale, likely_unit_m
from .floor_sweep import swept_floor
from .ground import AS_HELD, BY_DEVICE, BY_LOWEST_POINTS, Ground, find_ground, lowest, up_guess
from .scale import Scale, length_scale, marker_scale

ASSUMED_CAMERA_HEIGHT_M = 1.5
"""How high a photographer is taken to hold the camera when nothing tells the scale."""

# Share by which the unit of a device's poses and that of its depth sensor may differ.
_UNIT_AGREES = 0.03

# And from which on, as a logarithm, depth is in another unit than it is taken to be.
_OTHER_UNIT = np.log(1.3)

# Nobody holds a camera lower or higher above the floor, but from a balcony.
_HELD_BETWEEN_M = (0.3, 3.0)

# How a scale that hangs on the floor is called.
_HEIGHT_OF, _ASSUMED = " height of ", "assumed"

# Cosine of the angle within which an axis of the poses' frame is taken to be upright.
_UPRIGHT_AXIS = np.cos(np.radians(4.0))

# And within which a floor is looked for under one.
_ABOUT_UPRIGHT_AXIS = np.cos(np.radians(25.0))

# How a direction up is called that their frame tells.
_BY_AXIS = "upright as an axis of the poses"

# Points are this far off, and where there is none, a camera is held at least this high.
_POINTS_OFF_M, _LOWEST_HELD_M = 0.03, 0.5

# Sine of the angle from the vertical below which a camera's forward axis tells no heading.
_MIN_HEADING = 0.05


@dataclass(frozen=True)
class Registration:
    """The similarity from the capture frame to the world, and where it comes from.

    ``world_from_capture`` (4, 4) float64 has one uniform scale; the world is Z up, metres,
    z = 0 on the floor. ``ground`` and ``scale_source`` say in words how they were found.
    """

    world_from_capture: np.ndarray
    ground: str
    scale_source: str

    def captures(self, captures: Sequence[Capture]) -> tuple[Capture, ...]:
        """Captures of the capture frame in the world frame."""
        return tuple(capture.transformed(self.world_from_capture) for capture in captures)

    def sparse(self, sparse: SparsePoints) -> SparsePoints:
        """Sparse points of the capture frame in the world frame."""
        return sparse.transformed(self.world_from_capture)


def register(
    imported: Imported, sparse: SparsePoints, scale: Scale, settings: CaptureSettings, progress: Progress = SILENT
) -> Registration:
    """Register the captures to the world frame.

    z = 0 is the floor; the origin is the first capture's centre put down on it; the x-axis
    is the first capture's heading on it. An assumed scale and a floor that was not seen
    are reported as warnings. Where points do not show the floor of metric poses, it is looked for by plane
    sweeping, else it lies the cameras' height under them. Raises CaptureError when what should tell the scale does not.
    """
    captures = imported.captures
    known, source = _scale_before_ground(imported, sparse, scale, progress)
    unit_m = known if known is not None else USUAL_DEPTH_M / usual_depth(captures, sparse)
    cameras = [capture.camera for capture in captures]
    ground = find_ground(sparse.points, cameras, settings.floor_tolerance_m / unit_m, imported.up)
    if not ground.found:
        ground, known = _without_floor_points(imported, ground, known, scale, sparse.points)
        source = source or f"metric poses ({imported.source})" * (known is not None)
    if not ground.found:
        progress.message(
            f"{ground.description}: see in report/ground/ whether the room stands level on z = 0, and "
            "correct it with `r2sego register`, or add a photograph that shows the floor",
            level="warning",
        )
    if scale.kind == "depth" and known is not None and ground.found:
        _warn_of_height(captures, ground, known, scale, progress)
    if known is None:
        known, source = _scale_from_height(captures, ground, scale)
        if scale.kind != "camera_height":
            progress.message(
                f"the scale is {source}: distances may be off by a fifth; give a known length, a "
                "marker or the camera's height",
                level="warning",
            )
    return Registration(_world_from_capture(captures[0], ground, known), ground.description, source)


def _without_floor_points(
    imported: Imported, ground: Ground, known: float | None, scale: Scale, points: np.ndarray
) -> tuple[Ground, float | None]:
    """The ground where ``points`` (P, 3) show none, and the metres of a unit, None where the ground has to tell them.

    The given height of metric poses tells it. Else, where up and the unit are known, the floor is looked for by
    plane sweeping. Where that finds none, the floor lies no higher than next to all points, and than is usual
    under the cameras. Raises CaptureError where there is no point and nothing tells the unit.
    """
    given = scale.kind == "camera_height"
    unit_m = 1.0 if known is None and imported.metric and (given or not len(points)) else known
    if unit_m is None and len(points):
        return ground, None
    if unit_m is None:
        raise CaptureError(
            "the photographs share nothing, and nothing else tells how long a unit of their poses is",
            where="scale",
            cure="Declare the poses metric if they are, give a known length or a marker, or photograph from "
            "viewpoints that overlap by half.",
        )
    points = points[np.isfinite(points).all(axis=1)]
    if not given and (swept := _swept(imported, points, unit_m)):
        return swept, unit_m
    up, how = _upright(imported, ground, len(points))
    heights = np.array([capture.camera.centre for capture in imported.captures]) @ up
    if given:
        offset = float(heights[0]) - scale.metres / unit_m
        return Ground.unseen(up, offset, how, f"{scale.metres:g} m under the first camera, as given"), unit_m
    usual = float(np.median(heights)) - ASSUMED_CAMERA_HEIGHT_M / unit_m
    if len(points) and lowest(points, up) <= usual:
        return Ground.unseen(up, lowest(points, up), how, BY_LOWEST_POINTS), unit_m
    return Ground.unseen(up, usual, how, f"{ASSUMED_CAMERA_HEIGHT_M:g} m under the cameras, as is usual"), unit_m


def _swept(imported: Imported, points: np.ndarray, unit_m: float) -> Ground | None:
    """The floor that plane sweeping finds, not above next to all ``points`` (P, 3), in the poses' unit.

    It is looked for where up was measured, or about along an axis of metric poses: on planes that are not level
    nothing looks alike.
    """
    guess = up_guess([capture.camera for capture in imported.captures])
    up = imported.up if imported.up is not None else _nearest_axis(guess)
    up = up / np.linalg.norm(up)
    if imported.up is None and not (imported.metric and up @ guess > _ABOUT_UPRIGHT_AXIS):
        return None
    centres = np.array([capture.camera.centre for capture in imported.captures])
    highest = lowest(points, up) if len(points) else float((centres @ up).min()) - _LOWEST_HELD_M / unit_m
    in_metres = np.diag([unit_m, unit_m, unit_m, 1.0])
    scaled = [capture.transformed(in_metres) for capture in imported.captures]
    found = swept_floor(scaled, up, highest * unit_m + _POINTS_OFF_M)
    if found is None:
        return None
    how = _BY_AXIS if imported.up is None else BY_DEVICE
    told = f"floor by plane sweeping, {how}: {found.patches} patches look alike on it"
    return Ground(up, found.height_m / unit_m, found.patches, True, told)


def _upright(imported: Imported, ground: Ground, points: int) -> tuple[np.ndarray, str]:
    """The direction up (3,) where no floor tells it, and how it was found.

    The largest surface of the ``points`` may lean, so it comes last but for the cameras.
    """
    if imported.up is not None:
        return imported.up / np.linalg.norm(imported.up), BY_DEVICE
    guess = up_guess([capture.camera for capture in imported.captures])
    axis = _nearest_axis(guess)
    if (imported.metric or not points) and axis @ guess > _UPRIGHT_AXIS:
        return axis, _BY_AXIS
    if points:
        return ground.normal, ground.upright
    return guess, AS_HELD


def _nearest_axis(guess: np.ndarray) -> np.ndarray:
    """The axis (3,) of the poses' frame nearest to a guess of up: devices and programs align one with gravity."""
    axis = np.zeros(3)
    axis[np.argmax(np.abs(guess))] = np.sign(guess[np.argmax(np.abs(guess))])
    return axis


def corrected(
    registration: Registration,
    captures: Sequence[Capture],
    sparse: SparsePoints,
    ground: Ground | None,
    scale: Scale | None,
    progress: Progress = SILENT,
) -> tuple[Registration, np.ndarray]:
    """A registration with another ground or scale, and the (4, 4) similarity new from old world.

    ``captures`` and ``sparse`` are in the old world. Without ``ground`` the floor stays where
    it is, without ``scale`` the metre; a scale that came from a height above the old floor is
    pointed out in a warning. Raises CaptureError when what should tell the scale does not.
    """
    if ground is None:
        ground = Ground(np.array([0.0, 0.0, 1.0]), 0.0, 0, True, registration.ground)
    if scale is None:
        known, source = 1.0, registration.scale_source
        if _HEIGHT_OF in source or source.startswith(_ASSUMED):
            progress.message(
                f"the scale is kept, but it is from the floor as it was ({source}): give the camera's "
                "height again, or another scale",
                level="warning",
            )
    else:
        told, source = _scale_before_ground(Imported(tuple(captures), "", False), sparse, scale, progress)
        if told is None:
            told, source = _scale_from_height(captures, ground, scale)
        known = told
    turn_deg = np.degrees(np.arccos(np.clip(ground.normal[2], -1.0, 1.0)))
    moved_m = known * float(ground.height(captures[0].camera.centre)) - captures[0].camera.centre[2]
    progress.message(
        f"up turns by {turn_deg:.1f} degrees, a metre becomes {known:.3f} m, the first camera is "
        f"{abs(moved_m):.3f} m {'lower' if moved_m < 0.0 else 'higher'} above the floor"
    )
    similarity = _world_from_capture(captures[0], ground, known)
    together = similarity @ registration.world_from_capture
    return Registration(together, ground.description, source), similarity


def _scale_before_ground(
    imported: Imported, sparse: SparsePoints, scale: Scale, progress: Progress
) -> tuple[float | None, str]:
    """Metres per unit where that does not depend on the floor."""
    if scale.kind == "known_length":
        return length_scale(imported.captures, sparse, scale)
    if scale.kind == "marker":
        return marker_scale(imported.captures, scale)
    if scale.kind == "measured":
        return scale.metres, scale.whose
    if scale.kind == "metric":
        return 1.0, "poses declared to be metric"
    if scale.kind == "depth":
        measured = depth_scale(imported.captures, sparse, scale.sensor_depth(imported.depth))
        if imported.metric:
            _compare_units(imported, scale, measured.metres_per_unit, progress)
        return measured.metres_per_unit, str(measured)
    if scale.kind == "automatic" and not imported.metric and imported.depth is not None:
        try:
            measured = depth_scale(imported.captures, sparse, imported.depth)
            return measured.metres_per_unit, str(measured)
        except CaptureError as error:
            progress.message(f"the sensor's depth tells no scale: {error.what}", level="warning")
    if scale.kind == "automatic" and imported.metric:
        return 1.0, f"metric poses ({imported.source}{_checked(imported, sparse, progress)})"
    return None, ""


def _compare_units(imported: Imported, scale: Scale, metres_per_unit: float, progress: Progress) -> None:
    """Say where depth contradicts poses that are in metres; raise CaptureError where another unit explains it."""
    assert scale.folder is not None
    unit_m = likely_unit_m(scale.unit_m, metres_per_unit)
    if abs(np.log(metres_per_unit)) > _OTHER_UNIT and unit_m is not None:
        raise CaptureError(
            f"depth says that the room is {metres_per_unit:.3g} times as large as the poses in metres say",
            where=scale.folder,
            cure=f"These maps look like whole numbers of {_unit(unit_m)}: give --depth-unit {unit_m:.6g}. If the "
            "poses are in another unit, declare them not to be metric.",
        )
    if abs(metres_per_unit - 1.0) > _UNIT_AGREES:
        progress.message(
            f"the depth sensor sees the room {metres_per_unit - 1.0:+.1%} larger than the poses in metres say "
            f"({imported.source}); the sensor's metre is taken",
            level="warning",
        )


def _warn_of_height(
    captures: Sequence[Capture], ground: Ground, known: float, scale: Scale, progress: Progress
) -> None:
    """Say where the cameras of a scale from depth would stand as no photographer does."""
    height_m = known * float(np.median(ground.height(np.array([capture.camera.centre for capture in captures]))))
    low, high = _HELD_BETWEEN_M
    if low <= height_m <= high:
        return
    unit_m = likely_unit_m(scale.unit_m, height_m / ASSUMED_CAMERA_HEIGHT_M) if height_m > 0 else None
    right = [] if unit_m is None else [f"maps of {_unit(unit_m)} would say {height_m * unit_m / scale.unit_m:.2g} m: "]
    cure = f"give --depth-unit {(unit_m or 0.001):.6g}" if right else "say the unit with --depth-unit"
    progress.message(
        f"by the sensor's depth the cameras stand {height_m:.2g} m above the floor; are the maps in "
        f"{_unit(scale.unit_m)}? {''.join(right)}{cure}",
        level="warning",
    )


def _unit(metres: float) -> str:
    return "millimetres" if metres == 0.001 else f"1/{1.0 / metres:.6g} m"


def _checked(imported: Imported, sparse: SparsePoints, progress: Progress) -> str:
    """What the device's own depth says of its poses' unit, in words; never a change of it."""
    if imported.depth is None:
        return ""
    try:
        measured = depth_scale(imported.captures, sparse, imported.depth)
    except CaptureError as error:
        progress.message(f"the poses' unit is not checked by depth: {error.what}", level="warning")
        return ""
    difference = measured.metres_per_unit - 1.0
    if abs(difference) > max(_UNIT_AGREES, 3.0 * measured.uncertainty):
        progress.message(
            f"{imported.source}: the depth sensor sees the room {difference:+.1%} larger than the poses say, "
            f"which were taken; to take the sensor's metre give --depth {imported.depth.folder}",
            level="warning",
        )
    return f"; its depth says {difference:+.1%}: {measured}"


def _scale_from_height(captures: Sequence[Capture], ground: Ground, scale: Scale) -> tuple[float, str]:
    heights = ground.height(np.array([capture.camera.centre for capture in captures]))
    given = scale.kind == "camera_height"
    height = float(heights[0] if given else np.median(heights))
    if not height > 0:
        raise CaptureError(
            "the cameras are not above the floor",
            where="scale, camera height",
            cure="Give a known length or a marker instead.",
        )
    if given:
        return scale.metres / height, f"{scale.whose}{_HEIGHT_OF}{scale.metres:.4g} m"
    return (
        ASSUMED_CAMERA_HEIGHT_M / height,
        f"{_ASSUMED}: the cameras were held {ASSUMED_CAMERA_HEIGHT_M:g} m above the floor",
    )


def _world_from_capture(first: Capture, ground: Ground, scale: float) -> np.ndarray:
    """The similarity of the conventions: up, origin and heading from the floor and a camera."""
    up = ground.normal
    heading = first.camera.forward - up * (first.camera.forward @ up)
    if np.linalg.norm(heading) < _MIN_HEADING:
        # Looking straight down: the top of its image points ahead.
        top = -first.camera.world_from_camera[:3, 1]
        heading = top - up * (top @ up)
    heading /= np.linalg.norm(heading)
    rotation = np.stack([heading, np.cross(up, heading), up])
    centre = first.camera.centre
    origin = centre - up * float(ground.height(centre))
    similarity = np.eye(4)
    similarity[:3, :3] = scale * rotation
    similarity[:3, 3] = -scale * rotation @ origin
    return similarity
