"""Box rooms to roll out in, and the robots of the shared folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from legged_robots import hexapod_mjcf, quadruped_mjcf

from r2sego_blender.core.user_configuration import CONFIGURATION_VARIABLE
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.robot_file import EMBEDDED_WHEELED

ROBOTS = Path(__file__).resolve().parents[3] / "shared" / "robots"
_HALF_ROOM_M = (2.2, 2.0)
_FURNITURE = ((1.0, 0.8, 0.4, 0.3, 0.4), (-1.2, -0.6, 0.3, 0.5, 0.35), (0.0, -1.5, 0.5, 0.25, 0.45))

Box = Sequence[float]  # centre x, y; half sizes x, y, z; standing on the floor
BoxRoom = Callable[..., Path]


@pytest.fixture(autouse=True)
def configuration(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of this test's own for what a person decides for a machine: nobody has trusted anything."""
    folder = tmp_path_factory.mktemp("configuration")
    monkeypatch.setenv(CONFIGURATION_VARIABLE, str(folder))
    return folder


@pytest.fixture(scope="session")
def box_room(tmp_path_factory: pytest.TempPathFactory) -> BoxRoom:
    """``box_room(boxes)`` writes a closed room with ``boxes`` in it as MJCF."""

    def write(boxes: Sequence[Box] = _FURNITURE, floor: bool = True) -> Path:
        x, y = _HALF_ROOM_M
        geoms = [(f"{sx * (x + 0.05)} 0 1.25", f"0.05 {y} 1.25", f"wall_x{sx}") for sx in (-1, 1)] + [
            (f"0 {sy * (y + 0.05)} 1.25", f"{x} 0.05 1.25", f"wall_y{sy}") for sy in (-1, 1)
        ]
        geoms.append(("0 0 2.55", f"{x} {y} 0.05", "ceiling"))
        if floor:
            geoms.append(("0 0 -0.05", f"{x} {y} 0.05", "floor"))
        geoms += [(f"{cx} {cy} {hz}", f"{hx} {hy} {hz}", f"box{i}") for i, (cx, cy, hx, hy, hz) in enumerate(boxes)]
        text = "".join(f'<geom name="{n}" type="box" pos="{p}" size="{s}"/>' for p, s, n in geoms)
        path = tmp_path_factory.mktemp("room") / "scene.xml"
        path.write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        return path

    return write


@pytest.fixture(scope="session")
def humanoid() -> RobotModel:
    return RobotModel.load()


@pytest.fixture(scope="session")
def quadruped(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    return _written(tmp_path_factory, "quadruped.xml", quadruped_mjcf())


@pytest.fixture(scope="session")
def hexapod(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    return _written(tmp_path_factory, "hexapod.xml", hexapod_mjcf())


@pytest.fixture(scope="session")
def wheeled() -> RobotModel:
    return RobotModel.load(EMBEDDED_WHEELED)


@pytest.fixture(scope="session")
def shared_robot() -> Callable[[str], Path]:
    """The path of a shared robot's file, or a skip."""

    def find(name: str) -> Path:
        path = ROBOTS / name
        if not path.is_file():
            pytest.skip(f"{path} is not there")
        return path

    return find


@pytest.fixture(scope="session")
def distance_to_obstacles() -> Callable[[np.ndarray], np.ndarray]:
    """Distances (n,) of points (n, 2) on the floor to the furnished room's walls and boxes."""

    def distance(points: np.ndarray) -> np.ndarray:
        x, y = _HALF_ROOM_M
        found = [np.minimum(x - np.abs(points[:, 0]), y - np.abs(points[:, 1]))]
        for cx, cy, hx, hy, _ in _FURNITURE:
            outside = np.maximum(np.abs(points - (cx, cy)) - (hx, hy), 0.0)
            found.append(np.linalg.norm(outside, axis=1))
        return np.min(found, axis=0)

    return distance


def _written(folders: pytest.TempPathFactory, name: str, text: str) -> RobotModel:
    path = folders.mktemp("robot") / name
    path.write_text(text)
    return RobotModel.load(path)
