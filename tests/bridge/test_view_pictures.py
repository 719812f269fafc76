"""Comparisons, clips and camera paths as Blender's own data."""

import fake_bundle
import fake_views
import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.generation.show_path import show_path  # noqa: E402
from r2sego_blender.bridge.generation.view_pictures import compare_picture, image_of, read_levels, shown_part  # noqa: E402
from r2sego_blender.bridge.shared.cameras import camera_of  # noqa: E402
from r2sego_blender.bridge.shared.clip_images import clip_image, put_behind  # noqa: E402
from r2sego_blender.bridge.shared.image_editors import show_image  # noqa: E402
from r2sego_blender.bridge.shared.outliner import find_collection  # noqa: E402
from r2sego_blender.core.errors import SceneError  # noqa: E402
from r2sego_blender.core.images import load_image_uint8  # noqa: E402
from r2sego_blender.results.panels.view_parts import KINDS, clip_files, view_parts, views_of_round  # noqa: E402


@pytest.fixture
def record(bundle):
    return views_of_round(bundle, 0)[0]


def part_of(bundle, record, kind):
    return view_parts(bundle, record, [kind])[0]


def pixels(image):
    found = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(found)
    width, height = image.size
    return np.rint(found.reshape(height, width, 4)[::-1, :, :3] * 255).astype(np.uint8)


@pytest.mark.parametrize("kind", ["reference", "frame", "normal"])
def test_a_picture_is_read_as_it_is_stored(scene, bundle, record, kind):
    part = part_of(bundle, record, kind)
    label, picture = shown_part(part)
    np.testing.assert_array_equal(picture, load_image_uint8(part.file))
    assert label == part.label
    assert len(bpy.data.images) == 0


def test_depth_says_its_range_in_metres(scene, bundle, record):
    label, picture = shown_part(part_of(bundle, record, "depth"))
    near_m, far_m = fake_views.DEPTH_M
    assert label == f"proxy: depth, {near_m:.2f} to {far_m:.2f} m"
    assert picture[0, 0, 0] == 255 and picture[0, -1, 0] == 40 and picture[0, 25, 0] == 0


def test_provenance_is_read_by_its_numbers(scene, bundle, record):
    _, picture = shown_part(part_of(bundle, record, "provenance"))
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 4


def test_the_parts_stand_in_one_image(scene, bundle, record):
    image = compare_picture("Side by Side", view_parts(bundle, record, KINDS))
    assert len(image["parts"]) == 8 and "kept frame" in list(image["parts"])
    grid = pixels(image)
    frame = load_image_uint8(record.folder / "frame.png")
    places = np.argwhere((grid == frame[0, 0]).all(axis=-1))
    assert any((grid[y : y + 60, x : x + 80] == frame).all() for y, x in places)


def test_an_image_made_again_is_the_same_datablock(scene):
    first = image_of("one", np.full((4, 6, 3), 50, np.uint8))
    again = image_of("one", np.full((8, 2, 3), 90, np.uint8))
    assert first == again and tuple(again.size) == (2, 8)
    assert (pixels(again) == 90).all() and not again.is_dirty


def test_damage_and_nothing_at_all_are_errors(scene, tmp_path):
    file = tmp_path / "damaged.png"
    file.write_bytes(b"no image")
    with pytest.raises(SceneError, match=r"damaged\.png"):
        read_levels(file)
    assert len(bpy.data.images) == 0
    with pytest.raises(SceneError, match="no picture"):
        compare_picture("Side by Side", [])


def test_without_a_window_nothing_is_opened(scene):
    image, windows = image_of("one", np.zeros((2, 2, 3), np.uint8)), len(bpy.context.window_manager.windows)
    show_image(image, lambda _: pytest.fail("it is shown somewhere"))
    assert len(bpy.context.window_manager.windows) == windows


def test_the_camera_goes_along_the_path(scene, bundle):
    path = bundle.camera_path(0, 0)
    curve, camera = show_path(scene, bundle.path, "View 000", path, first_frame=5)
    for frame, expected in enumerate(path, start=5):
        scene.frame_set(frame)
        back = camera_of(camera)
        np.testing.assert_allclose(back.world_from_camera, expected.world_from_camera, atol=1e-6)
        assert (back.fx, back.cy) == (expected.fx, expected.cy)
    points = np.empty(4 * len(path), np.float32)
    curve.data.splines[0].points.foreach_get("co", points)
    np.testing.assert_allclose(points.reshape(-1, 4)[:, :3], [c.centre for c in path], atol=1e-6)
    assert (scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end) == (True, 5, 8)


def test_showing_another_path_replaces_the_first(scene, bundle):
    for _ in range(2):
        show_path(scene, bundle.path, "View 000", bundle.camera_path(0, 0))
    assert len(find_collection(scene, bundle.path, "Camera path").objects) == 2
    assert len(bpy.data.cameras) == len(bpy.data.curves) == 1


def test_a_clip_goes_with_its_camera_and_not_with_the_clip_of_another_scene(scene, bundle, record):
    files, path = clip_files(record.folder), bundle.camera_path(0, 0)
    for played in (scene, bpy.data.scenes.new("Other"), scene):
        _, camera = show_path(played, bundle.path, "View 000", path)
        put_behind(camera, clip_image("R2S-EGO Clip", files), len(files), 1)
    shown = [camera.background_images[0].image for camera in bpy.data.cameras]
    assert len(shown) == len(set(shown)) == 2 and None not in shown
    assert set(bpy.data.images) == set(shown)


def test_a_clip_is_a_sequence_behind_its_camera(scene, bundle, record):
    _, camera = show_path(scene, bundle.path, "View 000", bundle.camera_path(0, 0))
    files = clip_files(record.folder)
    for _ in range(2):
        image = clip_image("Clip 000", files)
    put_behind(camera, image, len(files), 1)
    (background,) = camera.data.background_images
    user = background.image_user
    assert background.image.source == "SEQUENCE" and len(bpy.data.images) == 1
    assert (user.frame_duration, user.frame_start, user.frame_offset) == (fake_bundle.PATH_FRAMES, 1, -1)
    assert bpy.path.abspath(image.filepath) == str(files[0])
