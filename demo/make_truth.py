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
from living_room import cameras
from make_room import build_room

from r2sego_blender.bridge.shared.meshes import arrays_from_mesh
from r2sego_blender.captures.poses.cameras_json import read_cameras_json
from r2sego_blender.captures.poses.photographs import captures_of
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView, save_ground_truth
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

PICTURES = Path(__file__).resolve().parent / "room"


def main(folder: Path) -> None:
    """Copy the pictures to ``folder``, which may not be there yet, and put the truth beside them."""
    if folder.exists():
        raise SystemExit(f"{folder} is there already: give another folder, or delete it.")
    partial = folder.with_name(f"{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(PICTURES, partial)
    build_room()
    vertices, faces, instances, names = true_surface()
    views = true_views(partial, vertices, faces, instances)
    save_ground_truth(GroundTruth(views, vertices, faces, instances, names), partial)
    partial.rename(folder)
    print(f"{folder}: {len(faces):,} true faces of {len(names)} things, depth of each capture")


def true_surface() -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[str, ...]]:
    """What Cycles renders: vertices, faces, instances and names as ``GroundTruth`` has them."""
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
        local, triangles = arrays_from_mesh(evaluated.to_mesh())
        evaluated.to_mesh_clear()
        world_from_part = np.array(evaluated.matrix_world)
        vertices.append(local @ world_from_part[:3, :3].T + world_from_part[:3, 3])
        faces.append(triangles + first)
        instances.append(np.full(len(triangles), names.index(piece), np.int64))
        first += len(local)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(instances), tuple(names)


def true_views(folder: Path, vertices: np.ndarray, faces: np.ndarray, instances: np.ndarray) -> tuple[TrueView, ...]:
    """What each capture of the folder's ``cameras.json`` sees of the surface."""
    photographs, _ = read_cameras_json(folder / "cameras.json", folder)
    room = MeshRasterizer(vertices, faces)
    views = []
    for photograph, capture in zip(photographs, captures_of(photographs, cameras.WIDTH_PX), strict=True):
        seen = room.render(capture.camera)
        ids = seen.of_face(instances, missing=-1).astype(np.int16)
        views.append(TrueView(photograph.path.stem, capture.camera, seen.depth, ids))
    return tuple(views)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the pictures and the truth go")
    main(parser.parse_args().folder)
