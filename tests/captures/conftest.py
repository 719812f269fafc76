"""A textured box room, ray cast exactly, and paths to the shared data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image

SHARED = Path(__file__).resolve().parents[3] / "shared"
TEXELS_PER_M = 160
ROOM_MIN, ROOM_MAX = np.array([-2.5, -3.0, 0.0]), np.array([2.5, 2.0, 2.6])


def _texture(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    texture = np.zeros((900, 900, 3), np.float32)
    for cell, weight in ((4, 0.4), (12, 0.6), (40, 0.5)):
        small = rng.random((900 // cell + 2, 900 // cell + 2, 3)).astype(np.float32)
        texture += weight * cv2.resize(small, (900, 900), interpolation=cv2.INTER_CUBIC)
    return np.clip(texture / 1.5, 0, 1)


class BoxRoom:
    """An axis-aligned room whose floor and walls have random textures."""

    def __init__(self) -> None:
        self.textures = [[_texture(2 * axis + side) for side in range(2)] for axis in range(3)]

    def image(self, camera: Camera) -> np.ndarray:
        """The photograph (H, W, 3) float32 and nothing else: no noise, no shading."""
        points = camera.unproject(self.depth(camera)).astype(np.float64)
        image = np.zeros((*camera.shape, 3), np.float32)
        for axis in range(3):
            others = [i for i in range(3) if i != axis]
            for side, bound in enumerate((ROOM_MIN[axis], ROOM_MAX[axis])):
                on = np.abs(points[..., axis] - bound) < 1e-6
                places = ((points[..., others] - ROOM_MIN[others]) * TEXELS_PER_M - 0.5).astype(np.float32)
                texture = self.textures[axis][side]
                colours = cv2.remap(texture, places[..., 0], places[..., 1], cv2.INTER_LINEAR)
                image[on] = colours[on]
        return image

    def depth(self, camera: Camera) -> np.ndarray:
        """Planar depth (H, W), float64."""
        rays = camera.rays() @ camera.world_from_camera[:3, :3].T
        with np.errstate(divide="ignore"):
            low, high = (ROOM_MIN - camera.centre) / rays, (ROOM_MAX - camera.centre) / rays
        return np.maximum(low, high).min(axis=2)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def room() -> BoxRoom:
    return BoxRoom()


@pytest.fixture(scope="session")
def room_bounds() -> tuple[np.ndarray, np.ndarray]:
    return ROOM_MIN, ROOM_MAX


@pytest.fixture(scope="session")
def room_cameras() -> list[Camera]:
    lens = Camera(400, 300, 300.0, 300.0, 200.0, 150.0, np.eye(4))
    places = [(-0.9, -2.3, 1.5), (-0.3, -2.4, 1.55), (0.3, -2.3, 1.5), (0.9, -2.2, 1.45), (1.4, -1.9, 1.6)]
    return [lens.at(look_at(place, (0.1, 0.6, 0.55))) for place in places]


@pytest.fixture(scope="session")
def room_captures(room, room_cameras, tmp_path_factory) -> list[Capture]:
    folder = tmp_path_factory.mktemp("room")
    captures = []
    for index, camera in enumerate(room_cameras):
        path = folder / f"photo{index}.png"
        save_image(path, room.image(camera))
        captures.append(Capture(path.name, path, camera))
    return captures


@pytest.fixture
def blank_photograph(rng) -> Callable[[Path, int, int], Path]:
    def write(path: Path, width: int = 64, height: int = 48) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_image(path, rng.random((height, width, 3)).astype(np.float32))
        return path

    return write


@pytest.fixture
def shared() -> Callable[[str], Path]:
    def find(name: str) -> Path:
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"the shared test data {name} is not on this machine")
        return path

    return find


@pytest.fixture
def messages() -> ProgressRecorder:
    return ProgressRecorder()
