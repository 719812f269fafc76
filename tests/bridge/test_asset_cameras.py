"""Pinholes in pixels of a person's own cameras, against Blender's projection."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Vector  # noqa: E402

from r2sego_blender.bridge.asset.asset_cameras import exact_camera  # noqa: E402
from r2sego_blender.bridge.shared.cameras import create_camera, use_frame_of  # noqa: E402
from r2sego_blender.core.cameras import Camera, look_at  # noqa: E402

LENS = Camera(640, 480, 500.0, 510.0, 310.0, 250.0, look_at((1.6, -1.4, 1.5), (0.0, 0.2, 0.4)))
POINTS = np.array([[0.0, 0.2, 0.4], [0.3, 0.1, 0.2], [-0.2, 0.5, 0.9]])


@pytest.fixture
def made(scene):
    camera = create_camera("lens", LENS)
    scene.collection.objects.link(camera)
    use_frame_of(camera, scene)
    return camera


def shown_px(scene, camera):
    """Where Blender shows the points, in pixels from the top left corner."""
    bpy.context.view_layer.update()
    seen = np.array([world_to_camera_view(scene, camera, Vector(point)) for point in POINTS])[:, :2]
    return seen * (1, -1) * (LENS.width, LENS.height) + (0, LENS.height)


def test_a_lens_as_it_was_made_is_exact(scene, made):
    scene.render.resolution_percentage = 50
    found = exact_camera(made, scene)
    assert (found.width, found.fx, found.fy, found.cy) == (LENS.width, LENS.fx, LENS.fy, LENS.cy)


@pytest.mark.parametrize(
    ("name", "value"), [("lens", 18.0), ("shift_x", 0.2), ("sensor_width", 24.0), ("sensor_fit", "VERTICAL")]
)
def test_a_lens_that_a_person_changed_is_the_one_they_see(scene, made, name, value):
    before = shown_px(scene, made)
    setattr(made.data, name, value)
    found = exact_camera(made, scene)
    assert (found.width, found.height) == (LENS.width, LENS.height)
    shown = shown_px(scene, made)
    assert np.abs(shown - before).max() > 10.0
    np.testing.assert_allclose(found.project(POINTS)[0], shown, atol=0.01)


@pytest.mark.parametrize("percentage", [29, 50, 57, 58, 100])
def test_a_picture_has_the_size_of_blenders_renders(scene, tmp_path, percentage):
    own = bpy.data.objects.new("own", bpy.data.cameras.new("own"))
    scene.collection.objects.link(own)
    scene.camera, scene.render.engine = own, "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = 700, 100
    scene.render.resolution_percentage = percentage
    found = exact_camera(own, scene)
    assert (found.width, found.height) == (700 * percentage // 100, percentage)
