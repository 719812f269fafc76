"""The letterbox to a program's own size."""

import box_room
import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import resize
from r2sego_blender.generation.generators.program import letterbox


@pytest.mark.parametrize(
    ("view", "size"),
    [
        ((640, 480), (1024, 576)),
        ((640, 480), (512, 320)),
        ((1920, 1080), (1024, 576)),
        ((480, 641), (1024, 576)),
        ((333, 101), (512, 320)),
        ((640, 480), (640, 480)),
        ((300, 300), (1024, 576)),
    ],
)
def test_a_letterboxed_pixel_is_the_same_ray(view, size):
    pose = look_at([0.3, -1.5, 1.2], [0.1, 0.5, 0.7])
    camera = Camera(*view, 0.7 * view[0], 0.69 * view[0], 0.51 * view[0], 0.48 * view[1], pose)
    box = letterbox(camera, *size)
    assert (box.camera.width, box.camera.height) == size
    assert box.view_width == size[0] or box.view_height == size[1]
    assert box.left >= 0 and box.left + box.view_width <= size[0]
    assert box.top >= 0 and box.top + box.view_height <= size[1]
    assert abs(size[0] - box.view_width - 2 * box.left) <= 1
    assert abs(size[1] - box.view_height - 2 * box.top) <= 1
    # the view's proportions, but for half a pixel
    assert abs(box.view_width / view[0] * view[1] - box.view_height) <= 0.5 * max(1, view[1] / view[0]) + 1e-9
    points = np.random.default_rng(1).uniform([-1, 0, 0], [1, 1, 1.4], (50, 3))
    wide, depth = box.camera.project(points)
    straight, same = camera.project(points)
    np.testing.assert_allclose(depth, same, rtol=1e-12)
    back = (wide - [box.left, box.top]) * [view[0] / box.view_width, view[1] / box.view_height]
    np.testing.assert_allclose(back, straight, rtol=0, atol=1e-9)
    assert box.cut(np.zeros((*box.camera.shape, 3))).shape == (box.view_height, box.view_width, 3)


@pytest.mark.parametrize("size", [(1024, 576), (512, 320), (200, 301)])
def test_what_is_cut_out_of_the_letterbox_is_the_view(size):
    target = box_room.lens(480, 360).at(look_at([0.1, -1.5, 1.3], [0.0, 0.5, 0.6]))
    box = letterbox(target, *size)
    wide, _ = box_room.render(box.camera)
    straight, _ = box_room.render(target)
    cut = resize(box.cut(wide), target.width, target.height)
    shifted = resize(np.roll(box.cut(wide), 1, axis=1), target.width, target.height)
    exact = box_room.psnr(cut, straight)
    assert exact > 28 and exact > box_room.psnr(shifted, straight) + 3
