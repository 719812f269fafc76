"""The extents of a robot's collision shapes: hulls of core points, grown by a radius."""

from __future__ import annotations

import mujoco
import numpy as np

_MESH, _SPHERE, _CAPSULE, _CYLINDER, _ELLIPSOID = (
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_MESH,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    )
)
# Round shapes are sampled finely enough for errors of half a percent of their radius.
_AROUND = 32
_ROUNDNESS = 1.1
_BOX_CORNERS = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T


def colliding(model: mujoco.MjModel) -> np.ndarray:
    """(n,) int: the geoms that can touch anything."""
    return np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0)


def core_points(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[np.ndarray, float]:
    """World points (n, 3) whose hull, grown by the radius in metres, is the posed geom's shape."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    radius_m = float(size[0]) if kind in (_SPHERE, _CAPSULE) else 0.0
    if kind == _MESH:
        mesh = model.geom_dataid[geom]
        start = model.mesh_vertadr[mesh]
        points = model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(np.float64)
    elif kind == _SPHERE:
        points = np.zeros((1, 3))
    elif kind == _CAPSULE:
        points = np.array([[0.0, 0.0, size[1]], [0.0, 0.0, -size[1]]])
    elif kind == _CYLINDER:
        turn = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
        rim = size[0] * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        end = np.array([0.0, 0.0, size[1]])
        points = np.concatenate([rim + end, rim - end])
    elif kind == _ELLIPSOID:
        turn, tilt = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, _AROUND), np.linspace(0.0, np.pi, _AROUND))
        sphere = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
        points = sphere.reshape(-1, 3) * size
    else:
        points = model.geom_aabb[geom, :3] + _BOX_CORNERS * model.geom_aabb[geom, 3:]
    return points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom], radius_m


def lowest_m(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> float:
    """The least world z of ``geoms``; infinite where there is none."""
    bottoms = [_bottom(*core_points(model, data, geom)) for geom in geoms]
    return min(bottoms, default=np.inf)


def highest_m(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> float:
    """The greatest world z of ``geoms``."""
    shapes = [core_points(model, data, geom) for geom in geoms]
    return max(float(points[:, 2].max()) + radius_m for points, radius_m in shapes)


def reach_m(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray, centre: np.ndarray) -> float:
    """The farthest any of ``geoms`` lies from the vertical through ``centre`` (2,)."""
    shapes = [core_points(model, data, geom) for geom in geoms]
    return max(float(np.linalg.norm(points[:, :2] - centre, axis=1).max()) + radius_m for points, radius_m in shapes)


def bearing_points(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray, thickness_m: float) -> np.ndarray:
    """World x and y (n, 2) of the points of ``geoms`` within ``thickness_m`` of their lowest."""
    shapes = [core_points(model, data, geom) for geom in geoms]
    ground = min(_bottom(*shape) for shape in shapes)
    return np.concatenate([points[points[:, 2] - radius_m < ground + thickness_m, :2] for points, radius_m in shapes])


def farthest_point(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray, start: np.ndarray, thickness_m: float
) -> np.ndarray:
    """World (3,) middle of the core points of ``geoms`` within ``thickness_m`` of the farthest from
    ``start`` (3,)."""
    points, reach = [], []
    for geom in geoms:
        core, radius_m = core_points(model, data, geom)
        points.append(core)
        reach.append(np.linalg.norm(core - start, axis=1) + radius_m)
    distances = np.concatenate(reach)
    return np.concatenate(points)[distances > distances.max() - thickness_m].mean(axis=0)


def is_round_about(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray, centre: np.ndarray, axis: np.ndarray
) -> bool:
    """Whether ``geoms`` reach equally far from ``centre`` (3,) in all directions across ``axis`` (3,)."""
    across = np.linalg.svd(axis[None])[2][1:]
    turn = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    directions = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    reach = np.zeros(_AROUND)
    for geom in geoms:
        points, radius_m = core_points(model, data, geom)
        reach = np.maximum(reach, ((points - centre) @ directions.T).max(axis=0) + radius_m)
    return bool(reach.max() < _ROUNDNESS * reach.min())


def _bottom(points: np.ndarray, radius_m: float) -> float:
    return float(points[:, 2].min()) - radius_m
