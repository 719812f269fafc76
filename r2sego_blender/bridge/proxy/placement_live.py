"""The prior that is being placed: its figures and outlines follow as it is moved."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...results.panels.bundle import Bundle
from ...results.panels.placement import Fit, outline, silhouette
from .object_masks import mask_images, read_mask, revision
from .placement_objects import Placement, placement_of, prior_name

_OUTLINE_PX = 160
_outlines: dict[tuple, np.ndarray] = {}
_current: dict[int, tuple[Placement, dict[str, int]]] = {}
"""By the session's number of the object, which renaming and undo leave as it is, what rates it, and
the revisions of the masks that it compares with."""


def begin(bundle: Bundle, shown: bpy.types.Object) -> tuple[Fit, float]:
    """Follow a shown prior from now on; its fit where it stands. Raises GeometryError."""
    forget()
    placement = placement_of(bundle, shown)
    if not placement.windows:
        raise GeometryError(
            f"'{prior_name(shown)}' has no masks to compare with",
            where=bundle.path,
            cure="Draw its mask in two captures at least.",
        )
    _current[shown.session_uid] = placement, _revisions(bundle.path, prior_name(shown))
    return rated(shown)


def followed(shown: bpy.types.Object) -> bool:
    """Whether this object is the one being placed."""
    return shown.session_uid in _current


def compares_with(bundle_path: str | Path, shown: bpy.types.Object) -> bool:
    """Whether this object is the one being placed, by the masks as they are now."""
    _, revisions = _current.get(shown.session_uid, (None, None))
    return revisions == _revisions(bundle_path, prior_name(shown))


def rated(shown: bpy.types.Object) -> tuple[Fit, float]:
    """The fit and the points' median distance, metres, where the followed prior stands now."""
    placement, _ = _current[shown.session_uid]
    return placement.rated(np.array(shown.matrix_world, np.float64))


def windows(shown: bpy.types.Object) -> tuple[str, ...]:
    """The captures in the order of the fit's overlaps."""
    placement, _ = _current[shown.session_uid]
    return tuple(window.name for window in placement.windows)


def prior_outline(shown: bpy.types.Object, capture: str) -> np.ndarray:
    """(2 S, 2) shares of the capture's frame, from its top left: the border of the prior's silhouette."""
    placement, _ = _current.get(shown.session_uid, (None, None))
    camera = placement.cameras.get(capture) if placement is not None else None
    if camera is None:
        return np.zeros((0, 2), np.float32)
    pose = np.array(shown.matrix_world, np.float64)
    key = ("prior", shown.session_uid, capture, pose.tobytes())
    if key not in _outlines:
        _drop("prior")
        small = _fitted(camera)
        drawn = silhouette(small, placement.placed(pose)) > 0.0
        _outlines[key] = outline(drawn) / (small.width, small.height)
    return _outlines[key]


def mask_outline(bundle_path: str, name: str, capture: str) -> np.ndarray:
    """(2 S, 2) shares of the capture's frame, from its top left: the border of an object's mask."""
    image = mask_images(bundle_path, name).get(capture)
    if image is None:
        return np.zeros((0, 2), np.float32)
    key = ("mask", bundle_path, name, capture, revision(image))
    if key not in _outlines:
        for old in [old for old in _outlines if old[:-1] == key[:-1]]:
            del _outlines[old]
        _outlines[key] = outline(read_mask(image)) / tuple(image.size)
    return _outlines[key]


def forget() -> None:
    """Follow nothing, and drop what was drawn."""
    _current.clear()
    forget_outlines()


def forget_outlines() -> None:
    """Draw all outlines anew: undo takes masks back, and their revisions with them."""
    _outlines.clear()


def _revisions(bundle_path: str | Path, name: str) -> dict[str, int]:
    return {capture: revision(image) for capture, image in mask_images(bundle_path, name).items()}


def _drop(kind: str) -> None:
    for key in [key for key in _outlines if key[0] == kind]:
        del _outlines[key]


def _fitted(camera: Camera) -> Camera:
    return camera.fitted(_OUTLINE_PX)
