"""Write the demo room's ground truth beside its pictures, as ``r2sego bench`` reads them.

    python demo/make_truth.py build/demo_truth
    r2sego bench generation --scene build/demo_truth

The true surface is that of the scene the pictures were rendered from. It is for scoring
only: no step of the method sees it. Needs pip's ``bpy`` and this project's library.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import bpy
import numpy as np
from make_room import build_room

from r2sego_blender.arrays import save_arrays
from r2sego_blender.captures.cameras_json import read_cameras_json
from r2sego_blender.captures.photographs import captures_of
from r2sego_blender.evaluation.ground_truth import TRUE_MESH
from r2sego_blender.geometry.rasterizer import MeshRasterizer

PICTURES = Path(__file__).resolve().parent / "room"
ANY_SIZE_PX = 1 << 20


def main(folder: Path) -> None:
    """Copy the pictures to ``folder``, which may not be there yet, and put the truth beside them."""
    if folder.exists():
        raise SystemExit(f"{folder} is there already: give another folder, or delete it.")
    partial = folder.with_name(f"{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(PICTURES, partial)
    build_room()
    vertices, faces, instances, names = true_surface()
    save_arrays(partial / TRUE_MESH, V=vertices, F=faces, I=instances, names=np.array(names))
    save_depths(partial, vertices, faces, instances)
    partial.rename(folder)
    print(f"{folder}: {len(faces):,} true faces of {len(names)} things, depth of each capture")


def true_surface() -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """What Cycles renders: (V, 3) float64 metres, (F, 3) and (F,) int32 of the piece's name in the list."""
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    vertices, faces, instances, names = [], [], [], []
    first = 0
    for part in bpy.context.scene.objects:
        if part.type != "MESH" or part.hide_render:
            continue
        piece = part.parent.name if part.parent else part.name
        if piece not in names:
            names.append(piece)
        evaluated = part.evaluated_get(depsgraph)
        local, triangles = triangulated(evaluated.to_mesh())
        evaluated.to_mesh_clear()
        world_from_part = np.array(evaluated.matrix_world)
        vertices.append(local @ world_from_part[:3, :3].T + world_from_part[:3, 3])
        faces.append(triangles + first)
        instances.append(np.full(len(triangles), names.index(piece), np.int32))
        first += len(local)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(instances), names


def triangulated(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) float64 and (F, 3) int32 of a mesh's triangles, in its own frame."""
    mesh.calc_loop_triangles()
    vertices = np.empty(len(mesh.vertices) * 3)
    mesh.vertices.foreach_get("co", vertices)
    triangles = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def save_depths(folder: Path, vertices: np.ndarray, faces: np.ndarray, instances: np.ndarray) -> None:
    """``depth/NAME.npz`` for each capture: planar depth ``z`` and which piece is seen, ``ids``."""
    (folder / "depth").mkdir()
    photographs, _ = read_cameras_json(folder / "cameras.json", folder)
    room = MeshRasterizer(vertices, faces)
    for photograph, capture in zip(photographs, captures_of(photographs, ANY_SIZE_PX), strict=True):
        seen = room.render(capture.camera)
        ids = seen.of_face(instances, missing=-1).astype(np.int16)
        save_arrays(folder / "depth" / f"{photograph.path.stem}.npz", z=seen.depth, ids=ids)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the pictures and the truth go")
    main(parser.parse_args().folder)
