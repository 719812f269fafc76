import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frame.ground_picture import ground_picture, save_ground_pictures
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import load_image_uint8, save_image

LENS = Camera(320, 240, 220.0, 220.0, 160.0, 120.0, np.eye(4))


def _capture(folder, pose, name="p.jpg"):
    path = folder / "p.png"
    save_image(path, np.zeros((240, 320, 3), np.uint8))
    return Capture(name, path, LENS.at(pose))


def _colour_at(picture, capture, point):
    (x, y), _ = capture.camera.project(np.array(point, float))
    return picture[int(y), int(x)].astype(int)


def test_lines_lie_where_the_floor_is(tmp_path):
    capture = _capture(tmp_path, look_at([-1.6, 0.3, 1.4], [1.0, 0.1, 0.0]))
    picture = ground_picture(capture)
    for node in ([2.0, 0.0, 0.0], [1.5, 1.0, 0.0], [2.0, -0.5, 0.0]):
        assert _colour_at(picture, capture, node).min() > 120
    for between in ([1.5, 0.5, 0.0], [2.5, 0.5, 0.0], [1.5, -0.5, 0.0]):
        assert _colour_at(picture, capture, between).max() == 0
    for axis, channel in (([0.5, 0, 0], 0), ([0, 0.5, 0], 1), ([0, 0, 0.5], 2)):
        colour = _colour_at(picture, capture, axis)
        assert colour[channel] > 200 and colour[channel] == colour.max()


def test_above_the_horizon_nothing_is_drawn(tmp_path):
    picture = ground_picture(_capture(tmp_path, look_at([5.0, 5.0, 1.4], [9.0, 8.0, 4.5])))
    assert picture.max() == 0


def test_pictures_are_written_beside_each_other(tmp_path):
    capture = _capture(tmp_path, look_at([-1.6, 0.3, 1.4], [1.0, 0.1, 0.0]))
    save_ground_pictures(tmp_path / "ground", [capture])
    assert np.array_equal(load_image_uint8(tmp_path / "ground" / "p.png"), ground_picture(capture))
