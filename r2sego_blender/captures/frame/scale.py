"""The scale of a room: metres for each unit of the capture frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from ...core.errors import CaptureError
from ...core.images import load_image_uint8
from ..capture import Capture
from ..sensors.sensor_depth import MILLIMETRE_M, SensorDepth
from ..sparse_points import SparsePoints
from .lifting import intersection, lifted, pointed_at

KNOWN_LENGTH = "scale, known_length"
"""Where errors about a known length say they are."""

_MARKER_DISAGREEMENT = 0.1
_SMALLEST_UNIT_M = 1e-6


@dataclass(frozen=True)
class Scale:
    """What tells the size of the room; make one with the functions below.

    ``automatic`` takes metric poses as they are and assumes a camera height otherwise.
    """

    kind: Literal["automatic", "metric", "known_length", "marker", "camera_height", "depth", "measured"] = "automatic"
    photo: str = ""
    pixel_a: tuple[float, float] = (0.0, 0.0)
    pixel_b: tuple[float, float] = (0.0, 0.0)
    metres: float = 0.0
    marker_id: int | None = None
    folder: Path | None = None
    whose: str = "camera"
    unit_m: float = MILLIMETRE_M

    def __post_init__(self) -> None:
        needs_metres = self.kind not in ("automatic", "metric", "depth")
        if needs_metres and not (np.isfinite(self.metres) and self.metres > 0):
            raise CaptureError(
                f"{self.metres} is no length in metres",
                where=f"scale, {self.kind}",
                cure="Give a positive number of metres.",
            )
        if not (_SMALLEST_UNIT_M <= self.unit_m <= 1.0):
            raise CaptureError(
                f"{self.unit_m} m is no unit of depth maps",
                where="scale, depth",
                cure="Give the metres of 1: 0.001 for millimetres, 0.0002 for TUM's.",
            )

    @staticmethod
    def automatic() -> Scale:
        """Metric poses as they are; else the cameras were held at a usual height."""
        return Scale()

    @staticmethod
    def metric() -> Scale:
        """The poses are in metres, whatever their file says."""
        return Scale("metric")

    @staticmethod
    def known_length(photo: str, pixel_a: tuple[float, float], pixel_b: tuple[float, float], metres: float) -> Scale:
        """Two points seen in one photograph are this far apart.

        Pixels are those of the upright photograph's file, at its full size.
        """
        (x_a, y_a), (x_b, y_b) = pixel_a, pixel_b
        return Scale("known_length", photo, (x_a, y_a), (x_b, y_b), metres)

    @staticmethod
    def marker(side_m: float, marker_id: int | None = None) -> Scale:
        """A printed ArUco marker (DICT_4X4_50) with this side lies in the room."""
        return Scale("marker", metres=side_m, marker_id=marker_id)

    @staticmethod
    def camera_height(metres: float, whose: str = "camera") -> Scale:
        """The first photograph was taken this high above the floor; ``whose`` height it is."""
        return Scale("camera_height", metres=metres, whose=whose)

    @staticmethod
    def measured(metres_per_unit: float, source: str) -> Scale:
        """Found elsewhere: a unit of now is so many metres; ``source`` says how that was found."""
        return Scale("measured", metres=metres_per_unit, whose=source)

    @staticmethod
    def depth(folder: Path, unit_m: float = MILLIMETRE_M) -> Scale:
        """Depth maps of a sensor, called as the photographs are (``SensorDepth``).

        ``unit_m`` is the unit of those of whole numbers.
        """
        return Scale("depth", folder=Path(folder), unit_m=unit_m)

    def sensor_depth(self, beside_poses: SensorDepth | None) -> SensorDepth:
        """The maps that a scale of kind ``depth`` names; those beside the poses where they are the same folder's."""
        assert self.folder is not None
        if beside_poses is not None and beside_poses.folder.resolve() == self.folder.resolve():
            return beside_poses
        return SensorDepth.beside(self.folder, self.unit_m)


def length_scale(captures: Sequence[Capture], sparse: SparsePoints, scale: Scale) -> tuple[float, str]:
    """Metres per unit from a known length, and its source in words."""
    index, pixels = pointed_at(captures, scale.photo, [scale.pixel_a, scale.pixel_b], KNOWN_LENGTH)
    ends = np.array([lifted(captures[index], sparse, index, pixel) for pixel in pixels])
    length = float(np.linalg.norm(ends[0] - ends[1]))
    if length < 1e-9:
        raise CaptureError("the two pixels are the same point", where=KNOWN_LENGTH, cure="Choose two points far apart.")
    return scale.metres / length, f"known length of {scale.metres:g} m in {scale.photo}"


def marker_scale(captures: Sequence[Capture], scale: Scale) -> tuple[float, str]:
    """Metres per unit from an ArUco marker seen in at least two captures."""
    seen: dict[int, list[tuple[Capture, np.ndarray]]] = {}
    for capture in captures:
        markers, shape = _markers(capture.image_path)
        for identity, corners in markers:
            seen.setdefault(identity, []).append((capture, capture.working_pixels(corners, shape)))
    if scale.marker_id is not None:
        seen = {scale.marker_id: seen.get(scale.marker_id, [])}
    views = max(seen.values(), key=len, default=[])
    _require_two(len(views))
    identity = next(key for key, value in seen.items() if value is views)
    cameras = [capture.camera for capture, _ in views]
    corners = np.array([intersection(cameras, [seen[k] for _, seen in views]) for k in range(4)])
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1)
    if not sides.min() > 0 or np.ptp(sides) > _MARKER_DISAGREEMENT * sides.mean():
        raise CaptureError(
            f"the sides of marker {identity} differ by more than {_MARKER_DISAGREEMENT:.0%}",
            where="scale, marker",
            cure="Photograph it larger, from places further apart, lying flat.",
        )
    source = f"marker {identity} with a side of {scale.metres:g} m in {len(views)} captures"
    return scale.metres / float(sides.mean()), source


def require_marker(photographs: Sequence[Path], scale: Scale) -> None:
    """Raise CaptureError unless two photographs show the marker: said before their poses are solved."""
    seen = Counter(identity for path in photographs for identity in {one for one, _ in _markers(path)[0]})
    wanted = seen if scale.marker_id is None else {scale.marker_id: seen[scale.marker_id]}
    _require_two(max(wanted.values(), default=0))


def _require_two(count: int) -> None:
    if count < 2:
        raise CaptureError(
            f"the marker was found in {count} capture{'s' if count != 1 else ''}, two are needed",
            where="scale, marker",
            cure="Use a flat marker of ArUco's DICT_4X4_50 with a white rim, large in two photographs.",
        )


def _markers(photograph: Path) -> tuple[list[tuple[int, np.ndarray]], tuple[int, int]]:
    """(id, corners (4, 2) in pixels) of the markers in a photograph, and its (height, width)."""
    image = load_image_uint8(photograph)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)
    corners, identities, _ = detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
    found = () if identities is None else zip(identities.ravel(), corners, strict=True)
    height, width = image.shape[:2]
    # OpenCV counts pixel centres from zero.
    return [(int(identity), quad.reshape(4, 2) + 0.5) for identity, quad in found], (height, width)
