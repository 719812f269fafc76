"""Renderings as Blender's images: one of a name, packed, behind the camera over its photograph."""

from pathlib import Path

import fake_bundle
import numpy as np
import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

import bpy

from r2sego_blender.bridge.asset.asset_pictures import load_picture, photograph_of, put_behind
from r2sego_blender.bridge.captures.show_captures import show_captures, show_photographs
from r2sego_blender.bridge.shared.cameras import create_camera
from r2sego_blender.bridge.shared.image_editors import show_in_editor
from r2sego_blender.bridge.shared.moved_bundle import turn_to
from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.images import save_image
from r2sego_blender.results.panels.bundle import Bundle


def picture(file, grey: float):
    save_image(file, np.full((4, 6, 3), grey, np.float32))
    return load_picture(file, "capture_0, final")


def test_a_new_rendering_takes_the_old_ones_place_everywhere(scene, tmp_path):
    camera = create_camera("capture_0", fake_bundle.cameras()[0])
    save_image(tmp_path / "photo.png", np.zeros((4, 6, 3), np.float32))
    camera.data.background_images.new().image = bpy.data.images.load(str(tmp_path / "photo.png"))
    put_behind(camera, picture(tmp_path / "picture.png", 0.2))
    put_behind(camera, picture(tmp_path / "picture.png", 0.8))
    photograph, rendering = (background.image for background in camera.data.background_images)
    assert (photograph.name, rendering.name) == ("photo.png", "capture_0, final")
    assert rendering.pixels[0] == pytest.approx(0.8, abs=0.01)
    assert len(bpy.data.images) == 2 and rendering.packed_file is not None
    assert photograph_of(camera) == photograph
    assert not show_in_editor(rendering)  # without a window there is none


def test_a_rendering_or_a_clip_behind_a_camera_is_no_photograph(scene, tmp_path):
    camera = create_camera("own", fake_bundle.cameras()[0])
    put_behind(camera, picture(tmp_path / "picture.png", 0.2))
    again = picture(tmp_path / "picture.png", 0.8)  # takes the place of the one behind the camera
    assert [one.image for one in camera.data.background_images] == [again]
    assert photograph_of(camera) is None
    again.source = "SEQUENCE"
    del again["r2sego_rendered"]
    assert photograph_of(camera) is None


def test_a_camera_without_a_photograph_has_none(scene):
    assert photograph_of(create_camera("own", fake_bundle.cameras()[0])) is None
    assert photograph_of(None) is None


def test_what_is_no_picture_is_refused_by_name(scene, tmp_path):
    with pytest.raises(SceneError, match=r"none\.png"):
        load_picture(tmp_path / "none.png", "a")


def test_hiding_the_photographs_leaves_a_rendering_as_it_is(scene, bundle, tmp_path):
    camera = show_captures(scene, bundle, points=False)[0]
    put_behind(camera, picture(tmp_path / "picture.png", 0.2))
    photograph, rendering = camera.data.background_images
    for shown in (False, True, False):
        show_photographs(scene, str(bundle.path), shown, 0.3)
        assert (photograph.show_background_image, photograph.alpha) == (shown, pytest.approx(0.3))
        assert rendering.show_background_image and rendering.alpha == 1.0
        assert camera.data.show_background_images
    put_behind(camera, picture(tmp_path / "picture.png", 0.8))
    assert not photograph.show_background_image  # a new rendering does not bring it back


def test_photographs_of_a_bundle_that_moved_are_shown(scene, tmp_path):
    bundle = Bundle.open(fake_bundle.write_bundle(tmp_path / "room.r2s"))
    camera = show_captures(scene, bundle, photographs=False, points=False)[0]
    moved = bundle.path.rename(tmp_path / "moved.r2s")
    turn_to(moved, str(bundle.path))
    show_photographs(scene, str(moved), True, 0.3)
    assert Path(photograph_of(camera).filepath).is_relative_to(moved)
