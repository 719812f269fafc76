"""Where the robot may stand: the free floor, asked of MuJoCo's own collision detection."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from scipy import ndimage
from skimage.measure import points_in_poly

from ...core.errors import NoFloorError, RobotError
from ..model.composition import compile_scene, geom_bounds, scene_spec
from ..model.model import RobotModel
from ..model.mujoco_warnings import mujoco_warnings
from ..scope.scope import FREE_FLOOR, BehaviourScope

CELL_M = 0.05
# The floor is looked for downwards from here.
_PROBE_FROM_M = 0.3
FLATNESS_M = 0.03
"""What rises above the floor by more than this is an obstacle, to the planner and to the judge."""
_MAX_CELLS = 400_000


@dataclass(frozen=True)
class FreeFloor:
    """A grid over the floor with cells of ``CELL_M``, row y, column x.

    ``origin_m`` (2,) is the world position of cell (0, 0)'s centre; ``free`` (ny, nx) bool,
    where the pelvis may be planned: one connected piece; ``region`` (ny, nx) bool, where it
    must stay; ``clearance_m`` (ny, nx) float64, distance to the nearest cell not free.
    """

    origin_m: np.ndarray
    free: np.ndarray
    region: np.ndarray
    clearance_m: np.ndarray
    floor_z_m: float

    def cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of world points (..., 2), clipped to the grid."""
        index = np.rint((np.asarray(points) - self.origin_m) / CELL_M).astype(int)
        rows, columns = self.free.shape
        return np.clip(index[..., 1], 0, rows - 1), np.clip(index[..., 0], 0, columns - 1)

    def points(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """World centres (..., 2) of cells."""
        return self.origin_m + CELL_M * np.stack([columns, rows], axis=-1)

    def is_free(self, points: np.ndarray) -> np.ndarray:
        """(...,) bool: which world points (..., 2) lie in free cells."""
        return self.free[self.cells(points)]

    def in_region(self, points: np.ndarray) -> np.ndarray:
        """(...,) bool: which world points (..., 2) lie in the region."""
        return self.region[self.cells(points)]


def free_floor(robot: RobotModel, scope: BehaviourScope, collision_mjcf: Path) -> FreeFloor:
    """The free floor of the scene for this robot and scope.

    A cell is free where an upright cylinder around the resting robot, from ``FLATNESS_M`` above
    the floor to the head and grown by the scope's clearance, touches nothing and a flat floor
    lies below. The largest
    connected piece is kept. Raises NoFloorError as ``require_floor`` does, and when nothing is left.
    """
    radius_m = robot.radius_m + scope.region.clearance_m
    model, probe = _with_probe(collision_mjcf, radius_m, robot.height_m)
    data = mujoco.MjData(model)
    centres, inside, floor_z = _floor(model, data, probe, scope, collision_mjcf)
    floor_z_m = float(np.nanmedian(floor_z))
    free = inside & (np.abs(floor_z - floor_z_m) < FLATNESS_M)
    with mujoco_warnings() as warned:
        for row, column in np.argwhere(free):
            data.qpos[:3] = (*centres[row, column], floor_z_m + (FLATNESS_M + robot.height_m) / 2.0)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            free[row, column] = data.ncon == 0 and not warned  # a contact it gave up on is one
            warned.clear()
    pieces, count = ndimage.label(free)
    if count == 0:
        raise NoFloorError(
            f"there is no free floor of {2.0 * radius_m:.2f} m across in the region",
            where=collision_mjcf,
            cure="Check the collision surface, or give the behaviour scope a smaller region.clearance_m "
            "(`r2sego robot --set`, in Blender Clearance under Behaviour Region).",
        )
    free = pieces == 1 + np.argmax(np.bincount(pieces.ravel())[1:])
    # The padding counts as not free, so the grid's own edge has no clearance.
    clearance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * CELL_M
    region = inside
    if scope.region.within == FREE_FLOOR:
        region = ndimage.distance_transform_edt(~free) * CELL_M <= radius_m
    return FreeFloor(centres[0, 0], free, region, clearance, floor_z_m)


def require_floor(scope: BehaviourScope, collision_mjcf: Path) -> None:
    """Raises NoFloorError where no surface to stand on lies in the scope's region, or in all the scene."""
    model, probe = _with_probe(collision_mjcf, 1.0, 1.0)
    _floor(model, mujoco.MjData(model), probe, scope, collision_mjcf)


def _floor(
    model: mujoco.MjModel, data: mujoco.MjData, probe: int, scope: BehaviourScope, collision_mjcf: Path
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (ny, nx, 2) of the grid's cells, which lie in the region (ny, nx), and the heights there (ny, nx)."""
    origin, rows, columns = _grid(model, probe, scope, collision_mjcf)
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    centres = origin + CELL_M * np.stack([x, y], axis=-1)
    inside = np.ones((rows, columns), bool)
    polygon = scope.region.within
    if polygon != FREE_FLOOR:
        inside = points_in_poly(centres.reshape(-1, 2), polygon).reshape(rows, columns)
    heights = _floor_heights(model, data, probe, centres, inside)
    if np.isfinite(heights).any():
        return centres, inside, heights
    if polygon != FREE_FLOOR:
        # Where there is none outside of the region either, that is what is told.
        everywhere = replace(scope, region=replace(scope.region, within=FREE_FLOOR))
        _floor(model, data, probe, everywhere, collision_mjcf)
        raise NoFloorError(
            "no floor lies in the region",
            where=f"scope {scope.name}, region.within",
            cure="Give one over the floor, or all of it: `r2sego robot SCENE --region free_floor`, in Blender Free "
            "Floor under Behaviour Region.",
        )
    raise NoFloorError(
        "the collision scene has no floor to stand on",
        where=collision_mjcf,
        cure="Photograph the floor; or lay the ground (`r2sego register`, in Blender Captures), or draw "
        "a floor at z = 0 (`r2sego edit-proxy --draw`, in Blender Edit Proxy).",
    )


def _with_probe(collision_mjcf: Path, radius_m: float, height_m: float) -> tuple[mujoco.MjModel, int]:
    spec = scene_spec(collision_mjcf)
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = 2, 1
    body = spec.worldbody.add_body(name="free_floor_probe", pos=(0.0, 0.0, -1000.0))
    body.add_freejoint()  # MuJoCo never collides two bodies that cannot move
    body.add_geom(
        name="free_floor_probe",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=(radius_m, (height_m - FLATNESS_M) / 2.0, 0.0),
        contype=1,
        conaffinity=2,
    )
    model = compile_scene(spec, collision_mjcf)
    return model, model.geom("free_floor_probe").id


def _grid(
    model: mujoco.MjModel, probe: int, scope: BehaviourScope, collision_mjcf: Path
) -> tuple[np.ndarray, int, int]:
    """Origin, rows and columns of a grid over the polygon or over all bounded geoms."""
    if scope.region.within != FREE_FLOOR:
        corners = np.asarray(scope.region.within)
        low, high = corners.min(axis=0), corners.max(axis=0)
    else:
        low, high = geom_bounds(model)
        bounded = np.isfinite(low).all(axis=1)
        bounded[probe] = False
        if not bounded.any():
            raise RobotError(
                "the collision scene has no bounds",
                where=collision_mjcf,
                cure="Give the behaviour scope a polygon as region.within.",
            )
        low, high = low[bounded].min(axis=0)[:2], high[bounded].max(axis=0)[:2]
    columns, rows = (np.floor((high - low) / CELL_M).astype(int) + 1).tolist()
    if rows * columns > _MAX_CELLS:
        raise RobotError(
            f"the region is {high[0] - low[0]:.0f} m by {high[1] - low[1]:.0f} m",
            where=collision_mjcf,
            cure="Give the behaviour scope a polygon of at most 1000 square metres as region.within.",
        )
    return low + ((high - low) - CELL_M * np.array([columns - 1, rows - 1])) / 2.0, rows, columns


def _floor_heights(
    model: mujoco.MjModel, data: mujoco.MjData, probe: int, centres: np.ndarray, inside: np.ndarray
) -> np.ndarray:
    """(ny, nx) float64: the first surface below ``_PROBE_FROM_M``; nan where there is none."""
    mujoco.mj_kinematics(model, data)
    heights = np.full(inside.shape, np.nan)
    down = np.array([0.0, 0.0, -1.0])
    touched = np.zeros(1, np.int32)
    probe_body = model.geom_bodyid[probe]
    for row, column in np.argwhere(inside):
        start = np.array([*centres[row, column], _PROBE_FROM_M])
        distance = mujoco.mj_ray(model, data, start, down, None, 1, probe_body, touched)
        if distance >= 0.0:
            heights[row, column] = _PROBE_FROM_M - distance
    return heights
