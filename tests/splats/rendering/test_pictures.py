"""Pictures of an asset are the rasteriser's and the outputs', to the value."""

import json

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import AssetError
from r2sego_blender.core.images import load_image_uint8, to_uint8
from r2sego_blender.splats.rendering.outputs import render_outputs
from r2sego_blender.splats.rendering.pictures import camera_entries, cameras_of, save_pictures
from r2sego_blender.splats.rendering.rasterizer import render
from tools.benchmarks.workloads import made_up_room


@pytest.fixture(scope="module")
def room():
    return made_up_room(800, (64, 48))


def test_pictures_and_arrays_are_those_of_the_outputs(room, tmp_path):
    camera = room.views[0].camera
    passes = ("colour", "alpha", "depth", "normals")
    files = save_pictures(room.asset, {"here": camera}, tmp_path / "out", passes)
    names = ["here.png", "here_alpha.png", "here_depth.png", "here_normals.png", "here.npz"]
    assert [file.name for file in files] == names and all(file.is_file() for file in files)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(names)
    expected = render_outputs(room.asset, camera)
    np.testing.assert_array_equal(load_image_uint8(files[0]), to_uint8(expected.colour))
    with np.load(files[-1]) as exact:
        assert sorted(exact) == ["alpha", "depth", "normals"]
        for name in exact:
            np.testing.assert_array_equal(exact[name], getattr(expected, name))


def test_colour_alone_is_the_evaluations_picture(room, tmp_path):
    cameras = {f"view {i}": room.views[0].camera.scaled(scale) for i, scale in enumerate((1.0, 0.5))}
    files = save_pictures(room.asset, cameras, tmp_path)
    assert [file.name for file in files] == ["view 0.png", "view 1.png"]
    for file, camera in zip(files, cameras.values(), strict=True):
        np.testing.assert_array_equal(load_image_uint8(file), to_uint8(render(room.asset, camera).colour))


def test_names_of_photographs_lose_their_suffix_unless_two_would_be_one(room, tmp_path):
    names = ["capture_00.png", "a.JPG", "a.png", "b.jpg", "B", "view.1", "c.png.jpg", "c.png"]
    cameras = dict.fromkeys(names, room.views[0].camera.scaled(0.25))
    files = [file.name for file in save_pictures(room.asset, cameras, tmp_path)]
    assert files == [
        "capture_00.png",
        "a.JPG.png",
        "a.png.png",
        "b.jpg.png",
        "B.png",
        "view.1.png",
        "c.png.jpg.png",
        "c.png",
    ]
    assert len({name.lower() for name in files}) == len(names)


def test_cameras_are_read_by_name_or_place(room, tmp_path):
    camera = room.views[0].camera.to_json()
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"captures": [{**camera, "name": "a"}, camera]}))
    cameras = cameras_of(camera_entries(file), file)
    assert list(cameras) == ["a", "001"] and cameras["a"].to_json() == camera


def test_a_pose_may_come_without_its_last_row(room, tmp_path):
    camera, file = room.views[0].camera, tmp_path / "cameras.json"
    entry = camera.to_json()
    file.write_text(json.dumps({"cameras": [{**entry, "world_from_camera": entry["world_from_camera"][:3]}]}))
    (read,) = cameras_of(camera_entries(file), file).values()
    assert read.to_json() == entry


def test_no_picture_of_a_camera_replaces_one_of_another(room, tmp_path):
    """The depth of ``a`` would be the colour of ``a_depth``."""
    cameras = dict.fromkeys(("A", "a_depth"), room.views[0].camera.scaled(0.25))
    with pytest.raises(AssetError, match=r"_depth\.png: .*Rename"):
        save_pictures(room.asset, cameras, tmp_path / "out", ("colour", "depth"))
    assert not (tmp_path / "out").exists()
    assert len(save_pictures(room.asset, cameras, tmp_path / "out")) == 2


def test_what_holds_for_all_cameras_is_said_once(tmp_path):
    """As in a cameras.json of captures."""
    entry = Camera(8, 6, 5.0, 5.5, 4.0, 3.0, np.eye(4)).to_json()
    lens = {key: entry.pop(key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"captures": [entry, entry | {"fx": 7.0}], **lens}))
    first, second = cameras_of(camera_entries(file), file).values()
    assert (first.width, first.fy, first.fx, second.fx) == (8, 5.5, 5.0, 7.0)
    del lens["height"]
    file.write_text(json.dumps({"captures": [entry], **lens}))
    with pytest.raises(AssetError, match=r"entry 0: the camera has no 'height'\. Give width, height, fx"):
        cameras_of(camera_entries(file), file)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "not JSON"),
        ("[]", "list 'cameras'"),
        ('{"cameras": [{"width": 3}]}', "entry 0"),
        ('{"cameras": ["a"]}', "entry 0"),
    ],
)
def test_damaged_cameras_are_refused_with_their_place(tmp_path, content, words):
    file = tmp_path / "cameras.json"
    file.write_text(content)
    with pytest.raises(AssetError, match=words):
        cameras_of(camera_entries(file), file)


@pytest.mark.parametrize(
    "change",
    [
        {"name": "../up"},
        {"name": ""},
        {"width": 10**6, "height": 10**6},
        {"width": -4, "height": -4},
        {"width": float("inf")},
        {"fx": 0.0},
        {"fx": float("nan")},
        {"fy": float("inf")},
        {"cx": float("nan")},
        {"cy": float("-inf")},
    ],
)
def test_a_camera_that_cannot_be_rendered_or_named_is_refused(room, tmp_path, change):
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"cameras": [{**room.views[0].camera.to_json(), **change}]}))
    with pytest.raises(AssetError, match=r"cameras\.json: (entry 0|it is not JSON)"):
        cameras_of(camera_entries(file), file)


@pytest.mark.parametrize("change", [np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0]), np.eye(4)[::-1]])
def test_a_pose_that_is_not_rigid_is_refused(room, tmp_path, change):
    file = tmp_path / "cameras.json"
    camera = room.views[0].camera.to_json()
    pose = np.array(camera["world_from_camera"]) @ change
    file.write_text(json.dumps({"cameras": [{**camera, "world_from_camera": pose.tolist()}]}))
    with pytest.raises(AssetError, match=r"entry 0: the pose is not a rotation and a translation. Give"):
        cameras_of(camera_entries(file), file)


def test_two_cameras_of_one_name_are_refused(room, tmp_path):
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"cameras": [{**room.views[0].camera.to_json(), "name": "a"}] * 2}))
    with pytest.raises(AssetError, match="entry 1"):
        cameras_of(camera_entries(file), file)
