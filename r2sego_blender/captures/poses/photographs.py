"""Photographs with poses, as the pose files name them, turned into captures."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PureWindowsPath

import numpy as np

from ...core.cameras import RIGID_CURE, is_rigid
from ...core.errors import CaptureError
from ...core.images import opened_image
from ...core.printable import printable
from ..capture import Capture
from ..lenses.lens import Lens

MIN_CAPTURES = 3
ANY_SIZE_PX = 1 << 20
"""As the longest side of captures: they keep their photographs' size."""

_EXIF_ORIENTATION = 274
# EXIF orientation -> clockwise quarter turns that set the stored pixels upright, of 4, 5 and 7
# before they are mirrored.
_QUARTER_TURNS = {3: 2, 4: 2, 5: 1, 6: 1, 7: 3, 8: 3}
_UPRIGHT_SIZE = ("HEIF", "TIFF")  # formats of which Pillow tells the upright size
_DEEP_MODES = frozenset({"I", "I;16", "I;16B", "I;16L", "I;16N", "F"})
_ASPECT_TOLERANCE = 0.01
# Focal lengths, in longest sides: 28 degrees, narrower than the lenses that rooms are photographed with,
# and 127 degrees, wider than any that keeps lines nearly straight.
_LONGEST_FOCAL, _SHORTEST_FOCAL = 2.0, 0.25
_NEARLY_PINHOLES = ("opencv", "brown")
_LISTED = 4
_REPLACE = "Replace the file, or take it out of the folder and the pose file."
# One clockwise quarter turn of the image, seen as a turn of the camera about its axis.
_TURNED_FROM_CAMERA = np.array(
    [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


@dataclass(frozen=True)
class Photograph:
    """A photograph, its lens and pose as a pose file states them.

    ``world_from_camera`` (4, 4) float64 has OpenCV axes; ``source`` is the file and field
    that errors point to, ``mask_path`` and ``depth_path`` the mask and the sensor's depth that are named for
    it, if they are there.
    ``stored_pixels``: what solved the poses does not turn photographs upright by EXIF. Raises CaptureError
    for a name that nobody can read, and a lens through which nothing is seen.
    """

    name: str
    path: Path
    lens: Lens
    world_from_camera: np.ndarray
    source: str
    mask_path: Path | None = None
    stored_pixels: bool = False
    depth_path: Path | None = None

    def __post_init__(self) -> None:
        require_name(self.name, self.source)
        try:
            self.lens.require_sensible()
        except ValueError as error:
            raise CaptureError(str(error), where=self.source, cure="Export the poses again.") from error


def require_name(name: str, where: object) -> None:
    """Raises CaptureError for a photograph's name with characters that control a terminal, or none at all."""
    if not name or printable(name, len(name)) != name:
        raise CaptureError(
            f"the photograph's name '{name}' has characters that cannot be shown",
            where=where,
            cure="Rename the file, also where its poses name it.",
        )


def photograph_size(path: Path) -> tuple[int, int, int]:
    """(width, height) of an image file's stored pixels and the clockwise quarter turns to upright.

    Raises CaptureError when the file is missing or not an image.
    """
    with opened_image(path, "photograph", _REPLACE) as image:
        orientation = image.getexif().get(_EXIF_ORIENTATION)
        if image.format == "HEIF":  # read upright, with an EXIF that says so
            orientation = image.info["original_orientation"]
        turns = _QUARTER_TURNS.get(int(orientation or 1), 0)
        turned_already = turns % 2 and image.format in _UPRIGHT_SIZE
        width, height = image.size[::-1] if turned_already else image.size
        return width, height, turns


def require_readable(paths: Sequence[Path]) -> None:
    """Raises CaptureError for the first of these that is missing or no image, and says how many are."""
    failed: dict[Path, CaptureError] = {}
    for path in paths:
        try:
            photograph_size(path)
        except CaptureError as error:
            failed[path] = error
    if failed:
        first, *others = failed.values()
        more = f"; nor can {len(others)} more of the {len(paths)}: {listed([*failed][1:])}" if others else ""
        raise CaptureError(f"{first.what}{more}", where=first.where, cure=first.cure) from first


def listed(paths: Sequence[Path]) -> str:
    """The names of files, of many the first and how many more."""
    more = f" and {len(paths) - _LISTED} more" if len(paths) > _LISTED else ""
    return ", ".join(path.name for path in paths[:_LISTED]) + more


def is_depth_map(path: Path) -> bool:
    """Whether an image file has one channel of more than 8 bits, as depth is stored beside photographs.

    Errors as for ``photograph_size``.
    """
    with opened_image(path, "photograph", _REPLACE) as image:
        return image.mode in _DEEP_MODES


def upright_size(path: Path) -> tuple[int, int]:
    """(width, height) of the photograph as ``load_image`` returns it."""
    width, height, turns = photograph_size(path)
    return (height, width) if turns % 2 else (width, height)


def require_lens_of_size(lens: Lens, where: object, keys: tuple[str, str]) -> None:
    """Raises CaptureError where a lens cannot be of the photograph's own size, which nobody stated.

    Numbers that were measured before the photographs were scaled are all too large by one factor, or too
    small. ``keys`` are the fields in which the size can be stated; whoever has such a lens states it there.
    """
    side = max(lens.width, lens.height)
    focal = max(lens.fx, lens.fy) / side
    across, along = 2.0 * lens.cx / lens.width, 2.0 * lens.cy / lens.height
    scaled = abs(across - along) < 0.1 * across and not 0.8 < across < 1.25
    if _SHORTEST_FOCAL * (lens.model in _NEARLY_PINHOLES) <= focal <= _LONGEST_FOCAL and not scaled:
        return
    angle_deg = 2.0 * np.degrees(np.arctan(0.5 / focal))
    what = (
        f"the principal point {lens.cx:g}, {lens.cy:g} lies far from the middle of"
        if scaled
        else f"the focal length {max(lens.fx, lens.fy):g} px makes {angle_deg:.0f} degrees of"
    )
    raise CaptureError(
        f"{what} a photograph of {lens.width}x{lens.height}: it is of another size",
        where=where,
        cure=f"Add '{keys[0]}' and '{keys[1]}': the size that it was measured at, which may be the photograph's.",
    )


def captures_of(photographs: Sequence[Photograph], max_side_px: int) -> tuple[Capture, ...]:
    """Captures of posed photographs, at most ``max_side_px`` long, intrinsics scaled exactly.

    Raises CaptureError for fewer than three photographs, for names used twice, files that
    are missing, unreadable or of another shape than their lens, and poses that are no
    rotation and translation.
    """
    if len(photographs) < MIN_CAPTURES:
        raise too_few(len(photographs), photographs[0].source if photographs else "captures")
    require_once_each(photographs)
    try:
        return posed_captures(photographs, max_side_px)
    except CaptureError:
        require_readable([photograph.path for photograph in photographs])  # else the error is another
        raise


def require_once_each(photographs: Sequence[Photograph]) -> None:
    """Raises CaptureError for a photograph that is listed more than once, by its name or by its file."""
    for spell in (lambda photograph: photograph.name, _place):
        for spelling, count in Counter(map(spell, photographs)).items():
            if count > 1:
                raise CaptureError(
                    f"the photograph '{spelling}' is listed {count} times",
                    where=photographs[0].source,
                    cure="Keep one entry for each photograph.",
                )


def posed_captures(photographs: Sequence[Photograph], max_side_px: int) -> tuple[Capture, ...]:
    """Captures of the photographs of one pose file, any number; other errors as for ``captures_of``."""
    half_turned = _half_turns_are_stored(photographs)
    return tuple(
        capture_of(
            photograph, max_side_px, half_turned=photograph.stored_pixels if half_turned is None else half_turned
        )
        for photograph in photographs
    )


def _half_turns_are_stored(photographs: Sequence[Photograph]) -> bool | None:
    """Whether poses are of the stored pixels where EXIF turns a photograph by half.

    Its shape does not tell that. Those by a quarter tell it for the whole file; else which way is up
    in the photographs that stand upright as they are stored. None: nothing tells.
    """
    up = {0: np.zeros(3), 2: np.zeros(3)}
    for photograph in photographs:
        width, height, turns = photograph_size(photograph.path)
        if turns in up:
            up[turns] -= photograph.world_from_camera[:3, 1]
        elif _same_shape(photograph.lens, width, height) != _same_shape(photograph.lens, height, width):
            return _same_shape(photograph.lens, width, height)
    agreement = up[0] @ up[2]
    return None if agreement == 0.0 else bool(agreement < 0.0)


def _place(photograph: Photograph) -> str:
    """Where the photograph lies, however its path is spelt."""
    return os.path.normcase(photograph.path.resolve())


def too_few(count: int, where: object) -> CaptureError:
    """The error for fewer photographs than geometry can be measured from."""
    return CaptureError(
        f"{count} photograph{'s' if count != 1 else ''} found, at least {MIN_CAPTURES} are needed",
        where=where,
        cure="Add photographs of the same room from places a step apart.",
    )


def capture_of(
    photograph: Photograph, max_side_px: int, files_needed: bool = True, half_turned: bool = False
) -> Capture:
    """The capture of one posed photograph; errors as for ``captures_of``.

    Without ``files_needed`` a photograph that is missing has the size its lens says.
    ``half_turned``: its pose is of the stored pixels where EXIF turns them by half.
    """
    pose = _rigid(photograph.world_from_camera, photograph.source)
    lens, turns = photograph.lens, 0
    if photograph.path.is_file() or files_needed:
        lens, pose, turns = _upright(photograph, pose, half_turned)
    try:
        camera = lens.straight(pose).fitted(max_side_px)
    except CaptureError as error:
        raise CaptureError(error.what, where=photograph.source, cure=error.cure) from error
    return Capture(
        photograph.name,
        photograph.path,
        camera,
        None if lens.plain else lens,
        mask_path=photograph.mask_path,
        quarter_turns=turns,
    )


def _upright(photograph: Photograph, pose: np.ndarray, half_turned: bool) -> tuple[Lens, np.ndarray, int]:
    """The lens and pose for the upright photograph at its true size, and the quarter turns to it."""
    lens = photograph.lens
    width, height, turns = photograph_size(photograph.path)
    upright = (height, width) if turns % 2 else (width, height)
    stored = _same_shape(lens, width, height) and not _same_shape(lens, *upright)
    if half_turned if turns == 2 else stored:
        # The poses were solved on the stored pixels, before EXIF turned them upright.
        lens = lens.turned(turns)
        for _ in range(turns):
            pose = pose @ _TURNED_FROM_CAMERA.T
    if not _same_shape(lens, *upright):
        raise CaptureError(
            f"the photograph {photograph.path.name} is {upright[0]}x{upright[1]}, its camera "
            f"{lens.width}x{lens.height}",
            where=photograph.source,
            cure="Give the photographs the poses were made for, or correct the camera's width and height.",
        )
    return (lens if (lens.width, lens.height) == upright else lens.scaled_to(*upright)), pose, turns


def _same_shape(lens: Lens, width: int, height: int) -> bool:
    return abs(lens.width / lens.height / (width / height) - 1.0) <= _ASPECT_TOLERANCE


def _rigid(pose: np.ndarray, source: str) -> np.ndarray:
    """The pose with its rotation made exact. Raises CaptureError if it is far from one."""
    if not is_rigid(pose):
        raise CaptureError("the pose is not a rotation and a translation", where=source, cure=RIGID_CURE)
    rotation = pose[:3, :3]
    if np.abs(rotation.T @ rotation - np.eye(3)).max() <= 1e-12:
        return pose
    left, _, right = np.linalg.svd(rotation)
    exact = pose.copy()
    exact[:3, :3] = left @ right
    return exact


def with_unique_names(photographs: Sequence[Photograph]) -> list[Photograph]:
    """Photographs of several folders under names that differ: the file name, else the path."""
    # A program on Windows writes its paths with backslashes.
    names = [PureWindowsPath(photograph.name).name for photograph in photographs]
    short = Counter(names)
    return [
        replace(photograph, name=name) if short[name] == 1 else photograph
        for photograph, name in zip(photographs, names, strict=True)
    ]
