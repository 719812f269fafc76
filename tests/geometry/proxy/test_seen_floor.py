"""The floor that captures vouch for."""

import numpy as np
import pytest
from room_meshes import observed_proxy

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.geometry.proxy.seen_floor import seen_floor


def floor_proxy(support: list[int], height_m: float = 0.0) -> GeometryProxy:
    """Unit squares side by side along x, two triangles each, with one support a square."""
    vertices, faces = [], []
    for x in range(len(support)):
        start = len(vertices)
        vertices += [(x, 0, height_m), (x + 1, 0, height_m), (x + 1, 1, height_m), (x, 1, height_m)]
        faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return observed_proxy(vertices, faces, np.repeat(support, 2))


def camera_at(x: float, y: float) -> Camera:
    return Camera(64, 48, 50, 50, 32, 24, look_at((x, y, 1.5), (x + 1.0, y, 1.0)))


def area(corners: np.ndarray) -> float:
    x, y = corners.T
    return 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))


def test_only_floor_that_a_capture_saw_counts():
    assert area(seen_floor(floor_proxy([1, 2, 0, 0]), [camera_at(0.5, 0.5)])) == pytest.approx(2.0)


def test_the_places_of_the_captures_count():
    corners = seen_floor(floor_proxy([1]), [camera_at(0.5, -1.0)])
    assert corners[:, 1].min() == pytest.approx(-1.0)
    assert area(corners) == pytest.approx(1.5)


def test_a_table_is_no_floor():
    with pytest.raises(GeometryError, match=r"no floor.*robot --region.*in Blender Draw Region"):
        seen_floor(floor_proxy([3, 3], height_m=0.7), [camera_at(0.5, 0.5)])
