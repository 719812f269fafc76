"""The visual asset as a mesh of loose vertices, one a splat: to draw from, and to select in."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...bundle.asset_stages import Stage
from ...results.panels.bundle import Bundle
from ...results.panels.file_stamps import MADE, when_written
from ...results.panels.splat_ply import read_stage
from ..shared.meshes import add_attribute, add_colours, mesh_from_arrays, read_attribute
from ..shared.moved_bundle import BUNDLE_MARK
from ..shared.outliner import fresh_collection, link

MARKED = "marked"
"""The attribute of the vertices that are to be deleted."""

_PART = "Asset"
_STAGE = "r2sego_stage"
_COLOUR, _SCALE, _ROTATION, _RADIUS = "colour", "scale", "rotation", "radius_m"
_OPACITY, _BACKDROP = "opacity", "backdrop"
_DRAWN = (_SCALE, _ROTATION, _RADIUS, _OPACITY, _BACKDROP, MARKED)
_OUTERMOST = "outermost"
_NO_TRIANGLES = np.empty((0, 3), np.int32)


@dataclass(frozen=True)
class DrawnSplats:
    """What the preview draws of N splats: ``means`` (N, 3) metres in the object's frame, ``colours``
    (N, 3) sRGB in [0, 1], standard deviations ``scales_m`` (N, 3) along the axes that ``quaternions``
    (N, 4) wxyz turn, ``radii_m`` and ``opacities`` (N,), all float32; ``backdrop`` and ``marked``
    (N,) bool.
    """

    means: np.ndarray
    colours: np.ndarray
    scales_m: np.ndarray
    quaternions: np.ndarray
    radii_m: np.ndarray
    opacities: np.ndarray
    backdrop: np.ndarray
    marked: np.ndarray

    def covariances(self, chosen: np.ndarray) -> np.ndarray:
        """(M, 6) float32, m2: xx, xy, xz, yy, yz, zz of the ``chosen`` splats (M,), in the object's frame."""
        turns = self.quaternions[chosen]
        w, x, y, z = (turns / np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12)).T
        rows = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        axes = [np.stack(row, axis=1) * self.scales_m[chosen] for row in rows]
        pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        return np.stack([(axes[i] * axes[j]).sum(axis=1) for i, j in pairs], axis=1)


def show_asset(scene: bpy.types.Scene, bundle: Bundle, stage: Stage) -> bpy.types.Object:
    """One of the bundle's assets, in place of the one shown before.

    The vertices carry ``colour``, ``scale``, ``rotation``, ``radius_m``, ``opacity``, ``backdrop``
    and ``marked``.
    Raises AssetError when its file is damaged.
    """
    splats = read_stage(stage, bundle.scene.geometry_folder / "backdrop.ply")
    collection = fresh_collection(scene, bundle.path, _PART)
    mesh = mesh_from_arrays(f"Asset, {stage.label.lower()}", splats.means, _NO_TRIANGLES)
    add_colours(mesh, _COLOUR, np.rint(splats.colours * 255.0))
    add_attribute(mesh, _SCALE, np.exp(splats.log_scales), "POINT")
    add_attribute(mesh, _ROTATION, splats.quaternions, "POINT")
    add_attribute(mesh, _RADIUS, splats.radii_m, "POINT")
    add_attribute(mesh, _OPACITY, splats.opacities, "POINT")
    add_attribute(mesh, _BACKDROP, splats.backdrop, "POINT")
    add_attribute(mesh, MARKED, np.zeros(len(splats), bool), "POINT")
    created = bpy.data.objects.new(mesh.name, mesh)
    created[_STAGE], created[MADE] = stage.name, when_written(stage.file)
    created.hide_render = True
    link(collection, created)
    _draw_only(created, _outermost(splats.means, splats.backdrop))
    return created


def _draw_only(created: bpy.types.Object, kept: np.ndarray) -> None:
    """Outside Edit Mode, of the object's points only those ``kept`` (M,) are Blender's to draw.

    The preview draws the splats; points would hide it, and are slow to draw.
    """
    created.vertex_groups.new(name=_OUTERMOST).add(kept.tolist(), 1.0, "REPLACE")
    mask = created.modifiers.new("Splats are drawn instead", "MASK")
    mask.vertex_group, mask.show_in_editmode = _OUTERMOST, False


def _outermost(means: np.ndarray, backdrop: np.ndarray) -> np.ndarray:
    """The splats that stand where the room ends, along x, y and z: a view of them is one of the room.

    The backdrop stands far behind it, and a few splats anywhere: a hundredth on each side do not count.
    """
    room = np.flatnonzero(~backdrop) if not backdrop.all() else np.arange(len(means))
    if not len(room):
        return room
    ends = [len(room) // 100, len(room) - 1 - len(room) // 100]
    return np.unique([room[np.argsort(means[room, axis])[ends]] for axis in range(3)])


def shown_stage(candidate: bpy.types.Object | None) -> str:
    """The name of the stage an object shows, '' when it was not made by ``show_asset``."""
    return str(candidate.get(_STAGE, "")) if candidate is not None else ""


def is_deleted(candidate: bpy.types.Object) -> bool:
    """Whether a person deleted an object, which a property that names it keeps alive."""
    return not candidate.users_collection


def shows_another(candidate: bpy.types.Object | None, stage: str) -> bool:
    """Whether an object shows an asset that is not of the stage ``stage``; none that was deleted does."""
    shown = shown_stage(candidate)
    return shown not in ("", stage) and not is_deleted(candidate)


def shows_bundle(candidate: bpy.types.Object, bundle: Bundle) -> bool:
    """Whether an object made by ``show_asset`` shows an asset of this bundle."""
    return candidate.get(BUNDLE_MARK) == str(bundle.path)


def is_current(candidate: bpy.types.Object, written: str) -> bool:
    """Whether an object made by ``show_asset`` shows a file as it was ``written``, with all that is drawn."""
    return candidate.get(MADE) == written and _is_whole(candidate.data)


def drawn_splats(mesh: bpy.types.Mesh) -> DrawnSplats | None:
    """The splats back from a mesh that ``show_asset`` made; None when its attributes are gone."""
    count = len(mesh.vertices)
    if not _is_whole(mesh):
        return None
    colours = np.empty(4 * count, np.float32)
    mesh.attributes[_COLOUR].data.foreach_get("color_srgb", colours)
    return DrawnSplats(
        centres_of(mesh), colours.reshape(-1, 4)[:, :3], *(read_attribute(mesh, name) for name in _DRAWN)
    )


def _is_whole(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh has all attributes that the preview draws."""
    return all(name in mesh.attributes for name in (_COLOUR, *_DRAWN))


def centres_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """(N, 3) float32, the vertices of a mesh in its object's frame."""
    centres = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", centres)
    return centres.reshape(-1, 3)


def set_marked(mesh: bpy.types.Mesh, marked: np.ndarray) -> None:
    """Mark the vertices (N,) bool as to be deleted, and no others."""
    mesh.attributes[MARKED].data.foreach_set("value", np.ascontiguousarray(marked, bool))
