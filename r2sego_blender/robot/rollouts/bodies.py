"""The robot's body for those who have no MuJoCo: its shapes as triangles, and each body's pose in
every frame of the rollouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import trimesh

from ...core.arrays import save_arrays
from ...core.cameras import Camera
from ...core.digests import content_digest
from ...core.errors import RobotError
from ...core.json_files import write_json
from ..model.model import RobotModel
from .rollout import Rollout

SHAPES, POSES, DESCRIPTION = "shapes.npz", "poses.npz", "bodies.json"
"""The files of a folder that ``save_bodies`` writes."""

# Shapes in higher groups are hidden by MuJoCo's viewer too: collision shapes, mostly.
_HIGHEST_GROUP = 2
_AROUND = 16
# How far a camera may move on its body before the poses are of another robot.
_SAME_MOUNT = 1e-5


@dataclass(frozen=True)
class BodyShape:
    """The look of a body: ``vertices`` (V, 3) float32 metres in the body's frame, ``faces``
    (F, 3) int32, and the colour of each face (F, 3) float32 sRGB in [0, 1]."""

    body: int
    name: str
    vertices: np.ndarray
    faces: np.ndarray
    colours: np.ndarray


def body_shapes(model: mujoco.MjModel) -> tuple[BodyShape, ...]:
    """Every body that can be seen, in MuJoCo's order.

    A body with shapes that are only drawn is shown by these, else by those that collide.
    """
    drawn = (model.geom_contype | model.geom_conaffinity) == 0
    shown = model.geom_group <= _HIGHEST_GROUP
    if not shown.any():
        shown[:] = True
    shapes = []
    for body in range(1, model.nbody):
        geoms = np.flatnonzero((model.geom_bodyid == body) & shown)
        if drawn[geoms].any():
            geoms = geoms[drawn[geoms]]
        parts = [part for geom in geoms if (part := _triangles(model, int(geom))) is not None]
        if not parts:
            continue
        starts = np.cumsum([0] + [len(vertices) for vertices, _, _ in parts[:-1]])
        shapes.append(
            BodyShape(
                body,
                model.body(body).name,
                np.concatenate([vertices for vertices, _, _ in parts]).astype(np.float32),
                np.concatenate([f + s for (_, f, _), s in zip(parts, starts, strict=True)]).astype(np.int32),
                np.concatenate([np.tile(colour, (len(f), 1)) for _, f, colour in parts]).astype(np.float32),
            )
        )
    return tuple(shapes)


def body_poses(model: mujoco.MjModel, qpos: np.ndarray, bodies: Sequence[int] | np.ndarray) -> np.ndarray:
    """``world_from_body`` (T, B, 4, 4) float64 of configurations ``qpos`` (T, nq): forward kinematics."""
    data = mujoco.MjData(model)
    bodies = np.asarray(bodies, int)
    poses = np.tile(np.eye(4), (len(qpos), len(bodies), 1, 1))
    for frame, configuration in zip(poses, np.asarray(qpos, np.float64), strict=True):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        frame[:, :3, :3] = data.xmat[bodies].reshape(-1, 3, 3)
        frame[:, :3, 3] = data.xpos[bodies]
    return poses


def save_bodies(
    folder: Path, robot: RobotModel, rollouts: Sequence[Rollout], camera: Camera, rollouts_folder: Path
) -> None:
    """Write the shapes and, for each rollout, the poses of all shown bodies at its frames.

    ``camera`` is the head camera's lens; its poses stand with the rollouts, whose folder's
    content is named, so that bodies of other rollouts are known as such. Camera flights have
    no body. Raises RobotError where the rollouts are another robot's.
    """
    shapes = body_shapes(robot.model)
    bodies = [shape.body for shape in shapes]
    flights = all(rollout.qpos.shape[1] == 0 for rollout in rollouts)
    poses = {}
    for index, rollout in enumerate(rollouts):
        if flights:
            shapes, bodies = (), []
            poses[_key(index)] = np.empty((len(rollout.qpos), 0, 4, 4))
            continue
        _check_robot(robot, rollout, index, rollouts_folder)
        poses[_key(index)] = body_poses(robot.model, rollout.qpos, bodies)
    save_arrays(folder / POSES, **poses)
    arrays = {}
    for index, shape in enumerate(shapes):
        for name in ("vertices", "faces", "colours"):
            arrays[f"{name}_{index:04d}"] = getattr(shape, name)
    save_arrays(folder / SHAPES, **arrays)
    lens = {key: value for key, value in camera.to_json().items() if key != "world_from_camera"}
    description = {
        "robot": robot.source,
        "bodies": [shape.name for shape in shapes],
        "camera": lens,
        "camera_rate_hz": _rate_hz(rollouts),
        "rollouts": content_digest(rollouts_folder / "rollouts.npz"),
    }
    write_json(folder / DESCRIPTION, description)


def _rate_hz(rollouts: Sequence[Rollout]) -> float:
    """Frames a second, of the longest rollout; times are whole steps of the simulation."""
    times_s = max((rollout.times_s for rollout in rollouts), key=len, default=np.empty(0))
    span_s = float(np.ptp(times_s)) if len(times_s) else 0.0
    return round((len(times_s) - 1) / span_s, 2) if span_s > 0.0 else 1.0


def _key(rollout: int) -> str:
    return f"world_from_body_{rollout:04d}"


def _check_robot(robot: RobotModel, rollout: Rollout, index: int, where: Path) -> None:
    """Refuse poses that are not this robot's: its camera would not stay on its body."""
    fits = rollout.qpos.shape[1] == robot.model.nq
    if fits and len(rollout.qpos):
        parent = robot.model.body(robot.mount.parent).id
        pose = body_poses(robot.model, rollout.qpos, [parent])[:, 0]
        mounted = np.linalg.inv(pose) @ rollout.camera_poses
        fits = bool(np.abs(mounted - mounted[0]).max() < _SAME_MOUNT)
    if not fits:
        raise RobotError(
            f"rollout {index} is another robot's than {robot.source}",
            where=where,
            cure="Run Refine again, or declare the robot it was made with.",
        )


def _triangles(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Vertices (V, 3) in the body's frame, faces (F, 3) and a colour (3,); None for endless shapes."""
    shape = _mesh(model, geom) or _primitive(int(model.geom_type[geom]), model.geom_size[geom])
    if shape is None:
        return None
    vertices, faces = shape
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    vertices = np.asarray(vertices, np.float64) @ turn.reshape(3, 3).T + model.geom_pos[geom]
    material = model.geom_matid[geom]
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return vertices, np.asarray(faces), rgba[:3]


def _mesh(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray] | None:
    mesh = int(model.geom_dataid[geom])
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return None
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return model.mesh_vert[first : first + count], model.mesh_face[start : start + faces]


def _primitive(kind: int, size: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    make, geom = trimesh.creation, mujoco.mjtGeom
    if kind == geom.mjGEOM_SPHERE:
        shape = make.uv_sphere(radius=size[0], count=(_AROUND // 2, _AROUND))
    elif kind == geom.mjGEOM_ELLIPSOID:
        shape = make.uv_sphere(radius=1.0, count=(_AROUND // 2, _AROUND)).apply_scale(size)
    elif kind == geom.mjGEOM_CAPSULE:
        shape = make.capsule(height=2.0 * size[1], radius=size[0], count=(_AROUND // 2, _AROUND))
        shape.apply_translation((0.0, 0.0, -shape.bounds.mean(axis=0)[2]))
    elif kind == geom.mjGEOM_CYLINDER:
        shape = make.cylinder(radius=size[0], height=2.0 * size[1], sections=_AROUND)
    elif kind == geom.mjGEOM_BOX:
        shape = make.box(extents=2.0 * size)
    else:
        return None
    return shape.vertices, shape.faces
