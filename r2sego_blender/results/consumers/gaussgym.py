"""GaussGym: splats, and a mesh with a path of camera poses that its loader keeps.

From escontra/gauss_gym at f356bc70 (BSD-3): ``scene_ingest.py``, ``math_utils.py`` and ``batch_gs_renderer.py``. Its
loader smooths the path, leaving up to a square metre of squared distances in all, so the poses are many; then it drops
those with a surface within 2 m above, or with none below anywhere in a disc half a metre across.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from ...core.arrays import save_arrays
from ...core.errors import RobotError
from ...core.json_files import write_json
from ...geometry.collision.collision_files import FLOOR, MESH_OBJ, SCENE_XML, read_obj
from ...robot.planning.free_floor import FreeFloor
from ...robot.planning.navigation import path_between, ways_from
from ...splats.formats.registry import save_asset
from .consumer import Consumer, ExportedRoom

SPLAT, TRANSFORMS, MESH = "splatfacto/splat.ply", "splatfacto/dataparser_transforms.json", "meshes/room.npz"
_EYE_M = 1.2  # above the floor
_CEILING_FROM_M, _LEVEL = 1.8, 0.7  # level faces from here on are the ceiling's
_HEADROOM_M, _DISC_M, _RIM_M = 2.0, 0.25, 0.03
_POSES, _LEAST_M = 1000, 0.5


def _write(room: ExportedRoom, folder: Path) -> None:
    floor = room.free_floor()
    vertices, triangles = open_above(room.collision, floor.floor_z_m)
    poses = camera_path(floor, vertices[triangles], str(room.collision))
    for name in (SPLAT, MESH):
        (folder / name).parent.mkdir()
    save_asset(folder / SPLAT, room.asset)
    write_json(folder / TRANSFORMS, {"transform": np.eye(3, 4).tolist(), "scale": 1.0})
    save_arrays(
        folder / MESH,
        vertices=vertices.astype(np.float32),
        triangles=triangles.astype(np.uint32),
        cam_trans=poses.astype(np.float32),
        cam_quat=np.tile(np.array([0.0, 0.0, 0.0, 1.0], np.float32), (len(poses), 1)),
        offset=np.zeros((1, 3), np.float32),
        from_ig_rotation=np.eye(3, dtype=np.float32),
    )


def open_above(collision: Path, floor_z_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (T, 3) of the collision mesh without its ceiling, with all of its floor."""
    vertices, triangles = read_obj(collision / MESH_OBJ)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = np.abs(normals[:, 2]) > _LEVEL * np.linalg.norm(normals, axis=1)
    kept = triangles[~(level & (corners[:, :, 2].min(axis=1) > floor_z_m + _CEILING_FROM_M))]
    model = mujoco.MjModel.from_xml_path(str(collision / SCENE_XML))
    floor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR)
    if floor < 0:
        return vertices, kept
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, model.geom_quat[floor])
    signs = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)])
    top = model.geom_pos[floor] + (signs * model.geom_size[floor]) @ turned.reshape(3, 3).T
    square = np.array([[0, 1, 2], [0, 2, 3]]) + len(vertices)
    return np.concatenate([vertices, top]), np.concatenate([kept, square])


def camera_path(floor: FreeFloor, corners: np.ndarray, where: str) -> np.ndarray:
    """(1000, 3) poses along the longest way over the free floor, or along what of it the loader would keep.

    ``corners`` (T, 3, 3) are the mesh's triangles. Raises RobotError where less than half a metre is left.
    """
    ends = np.argwhere(floor.clearance_m == floor.clearance_m.max())[0]
    for _ in range(2):  # the farthest from anywhere, and the farthest from there
        start = ends
        _, way_m = ways_from(floor, start[:1], start[1:])
        ends = np.array(np.unravel_index(np.argmax(np.where(np.isfinite(way_m), way_m, -1.0)), way_m.shape))
    path = path_between(floor, (int(start[0]), int(start[1])), (int(ends[0]), int(ends[1])))
    assert path is not None  # both are cells of one piece
    places = np.column_stack([path, np.full(len(path), floor.floor_z_m + _EYE_M)])
    kept = np.array([is_kept(place, corners) for place in places])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(int)))
    run = max(zip(edges[::2], edges[1::2], strict=True), key=lambda one: one[1] - one[0], default=(0, 0))
    places = places[slice(*run)]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    if along[-1] < _LEAST_M:
        raise RobotError(
            f"GaussGym's camera has {along[-1]:.2f} m to move along on the free floor",
            where=where,
            cure="Give the scope a smaller region.clearance_m, or check the collision surface.",
        )
    at = np.linspace(0.0, along[-1], _POSES)
    return np.stack([np.interp(at, along, places[:, axis]) for axis in range(3)], axis=1)


def is_kept(place: np.ndarray, corners: np.ndarray) -> bool:
    """Whether GaussGym's loader would keep a pose at ``place`` (3,), and a little around it."""
    grid = np.linspace(-1.0, 1.0, 12) * (_DISC_M + _RIM_M)
    offsets = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    points = place[:2] + offsets[np.linalg.norm(offsets, axis=1) <= _DISC_M + _RIM_M]
    heights = _heights(points, corners) - place[2]
    is_above = (heights > 0.0) & (heights <= _HEADROOM_M)
    return bool((heights < 0.0).any(axis=1).all() and not is_above.any())


def _heights(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(P, T) z where the vertical through each of ``points`` (P, 2) meets each triangle; nan where it does not."""
    flat = corners[:, :, :2]
    beside = (flat.max(axis=1) < points.min(axis=0)) | (flat.min(axis=1) > points.max(axis=0))
    a, b, c = corners[~beside.any(axis=1)].transpose(1, 0, 2)
    ab, ac, ap = b - a, c - a, points[:, None] - a[:, :2]
    double = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # of triangles that stand upright
        u = (ap[..., 0] * ac[:, 1] - ap[..., 1] * ac[:, 0]) / double
        v = (ab[:, 0] * ap[..., 1] - ab[:, 1] * ap[..., 0]) / double
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        return np.where(inside, a[:, 2] + u * ab[:, 2] + v * ac[:, 2], np.nan)


CONSUMER = Consumer("gaussgym", "for GaussGym: splatfacto/ and meshes/, with a path that its loader keeps", _write)
