"""A small closed room with a table, as an export has it, for other people's training code."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from room_meshes import closed_room, observed_proxy

from r2sego_blender.config.settings import CollisionSettings
from r2sego_blender.geometry.collision.collision import CollisionSurface, collision_surface
from r2sego_blender.geometry.collision.collision_files import SCENE_XML, write_collision
from r2sego_blender.results.consumers.consumer import ExportedRoom
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.scope.scope import BehaviourScope
from tools.benchmarks.workloads import made_up_room

SIZE_M = (3.2, 2.6, 2.5)
TABLE = ((0.7, -1.2, 0.65), (1.5, -0.4, 0.7))


@cache
def surface() -> CollisionSurface:
    """What its proxy becomes."""
    mesh = closed_room(SIZE_M, TABLE)
    for _ in range(3):
        mesh = mesh.subdivide()
    return collision_surface(observed_proxy(mesh.vertices, mesh.faces), CollisionSettings())


def exported_room(folder: Path, gaussians: int = 200) -> ExportedRoom:
    """The room in ``folder``, with some Gaussians of degree 1."""
    write_collision(surface(), folder / "collision")
    asset = made_up_room(gaussians, (64, 48)).asset.with_degree(1)
    robot, scope = RobotModel.load(), BehaviourScope.load("sit_down")
    return ExportedRoom(asset, folder / "collision", lambda: free_floor(robot, scope, folder / "collision" / SCENE_XML))


def corners() -> np.ndarray:
    """(8, 3) of its box."""
    x, y, z = SIZE_M
    return np.array([(sx * x / 2, sy * y / 2, height) for sx in (-1, 1) for sy in (-1, 1) for height in (0.0, z)])
