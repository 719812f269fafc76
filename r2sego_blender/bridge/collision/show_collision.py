"""The collision surface of a bundle, and its textured proxy, as Blender meshes."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.gltf_files import require_whole
from ...core.text_files import read_text
from ...results.panels.bundle import Bundle
from ...results.panels.file_stamps import MADE, when_written
from ..shared.materials import ramp_materials
from ..shared.meshes import add_attribute, assign_materials, mesh_from_arrays
from ..shared.outliner import find_collection, fresh_collection, link, remove_unused

_PART, _TEXTURED = "Collision", "Textured proxy"
_PIECE_COLOURS = 8
_MOST_BYTES = 256 << 20


def show_collision(scene: bpy.types.Scene, bundle: Bundle, *, pieces: bool = True) -> bpy.types.Object:
    """The convex pieces (or the one mesh) in one object, in place of the one shown before.

    Faces carry the attribute ``piece``. Raises SceneError when the bundle has no collision
    surface or a mesh file is damaged.
    """
    files = bundle.collision_hulls if pieces else [bundle.collision_mesh]
    if not files or not files[0].is_file():
        raise SceneError("there is no collision surface", where=bundle.scene.collision_folder, cure="Run Refine first.")
    parts = [read_obj(file) for file in files]
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    vertices = np.concatenate([v for v, _ in parts])
    faces = np.concatenate([f + start for (_, f), start in zip(parts, starts, strict=True)])
    piece = np.repeat(np.arange(len(parts), dtype=np.int32), [len(f) for _, f in parts])
    collection = fresh_collection(scene, bundle.path, _PART)
    mesh = mesh_from_arrays("Collision", vertices, faces)
    add_attribute(mesh, "piece", piece)
    # Neighbouring pieces get distant colours, so that their borders show.
    assign_materials(mesh, ramp_materials("R2S-EGO piece", _PIECE_COLOURS), piece * 3 % _PIECE_COLOURS)
    created = bpy.data.objects.new(mesh.name, mesh)
    created[MADE] = when_written(bundle.collision_mesh)
    link(collection, created)
    return created


def shows_older_collision(scene: bpy.types.Scene, bundle_path: str, now: str) -> bool:
    """Whether a collision surface is shown that was not made of the file written at ``now``."""
    collection = find_collection(scene, bundle_path, _PART)
    shown = collection.objects if collection is not None else ()
    return any(MADE in one and one[MADE] != now for one in shown)


def show_textured(scene: bpy.types.Scene, bundle: Bundle, file: Path) -> list[bpy.types.Object]:
    """The textured proxy of a GLB file, in place of the one shown before.

    Blender's importer turns glTF's Y up into Z up; the file is in glTF's axes. Raises SceneError
    when it cannot be read, or names files that are not in it: the importer would follow them anywhere.
    """
    if file.is_file():
        require_whole(file, SceneError)
    before = set(bpy.data.objects)
    try:
        bpy.ops.import_scene.gltf(filepath=str(file))
    except AttributeError as error:
        raise SceneError(
            "Blender's importer of glTF is switched off",
            where=file,
            cure="Switch the add-on 'glTF 2.0 format' on in the preferences.",
        ) from error
    except RuntimeError as error:
        raise SceneError(f"the textured mesh cannot be read: {error}", where=file, cure="Texture again.") from error
    added = [one for one in bpy.data.objects if one not in before]
    materials, images = _looks(find_collection(scene, bundle.path, _TEXTURED))
    collection = fresh_collection(scene, bundle.path, _TEXTURED)
    remove_unused(materials)
    remove_unused(images)
    for one in added:
        for other in list(one.users_collection):
            other.objects.unlink(one)
        link(collection, one)
    return added


def _looks(textured: bpy.types.Collection | None) -> tuple[set[bpy.types.Material], set[bpy.types.Image]]:
    """The materials of what is shown textured, and their images."""
    shown = textured.objects if textured is not None else ()
    materials = {slot.material for one in shown for slot in one.material_slots if slot.material}
    trees = [material.node_tree for material in materials if material.node_tree]
    return materials, {node.image for tree in trees for node in tree.nodes if getattr(node, "image", None)}


def read_obj(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 and triangles (F, 3) int32 of an OBJ of triangles.

    Blender's own importer turns axes and makes objects; these files are in the world frame.
    """
    try:
        rows = [line.split() for line in read_text(file, _MOST_BYTES).splitlines()]
        vertices = np.array([row[1:4] for row in rows if row[:1] == ["v"]], np.float32)
        corners = [[corner.partition("/")[0] for corner in row[1:]] for row in rows if row[:1] == ["f"]]
        faces = np.array(corners, np.int32).reshape(-1, 3) - 1
        vertices = vertices.reshape(-1, 3)
        if not np.isfinite(vertices).all() or (faces < 0).any() or (faces >= len(vertices)).any():
            raise ValueError("a vertex is not finite, or a face names one that is not there")  # Blender would end
    except (OSError, ValueError, OverflowError) as error:
        raise SceneError(f"the mesh cannot be read: {error}", where=file, cure="Run Refine again.") from error
    return vertices, faces
