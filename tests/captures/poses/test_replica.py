"""Walks through Replica in both layouts: frame numbers, lenses and axes as the programs that made them say."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from dataset_folders import nice_slam, pose, semantic_nerf
from expected_errors import refused
from PIL import Image

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.dropped_files import capture_files
from r2sego_blender.captures.poses.registry import find_poses
from r2sego_blender.captures.poses.replica import read_walk
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError

SETTINGS = CaptureSettings()


@pytest.mark.parametrize("make", [semantic_nerf, nice_slam])
def test_a_walk_is_read_where_it_lies_and_its_depth_stays_out(tmp_path, make):
    file = make(tmp_path / "office", 12)
    for place in (file, file.parent):
        assert find_poses(place)[1] == file
    imported = import_captures(file.parent, None, SETTINGS)
    assert imported.metric and imported.depth is None and len(imported.captures) == 12
    for number, capture in enumerate(imported.captures):  # the tenth frame is no second one
        assert str(number) in capture.name and np.abs(capture.camera.world_from_camera - pose(number)).max() < 1e-12
    dropped = capture_files([file], ".r2s")
    assert dropped.poses == file and dropped.photographs == capture.image_path.parent
    assert dropped.scene == tmp_path / "office.r2s"


def test_rays_of_semantic_nerf_are_those_of_its_trainer(tmp_path):
    """There hfov is 90, cx = (W - 1) / 2, and pixels counted from 0."""
    camera = import_captures(semantic_nerf(tmp_path / "office", 3).parent, None, SETTINGS).captures[1].camera
    focal = camera.width / 2.0 / math.tan(math.radians(90.0 / 2.0))
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    expected = np.stack([(x - (camera.width - 1) / 2) / focal, (y - (camera.height - 1) / 2) / focal], axis=-1)
    assert np.abs(camera.rays()[..., :2] - expected).max() < 1e-9


@pytest.mark.parametrize("at", ["", "office/", None])
def test_rays_of_nice_slam_are_those_of_its_lens(tmp_path, at):
    """``cam_params.json`` above the scene or in it, else its configuration; pixels counted from 0."""
    lens = {"w": 120, "h": 68, "fx": 60.0, "fy": 61.0, "cx": 59.5, "cy": 33.5, "scale": 6553.5}
    size = (120, 68) if at is not None else (1200, 680)
    file = nice_slam(tmp_path / "office", 3, size)
    if at is None:
        lens = {"fx": 600.0, "fy": 600.0, "cx": 599.5, "cy": 339.5}
    else:
        (tmp_path / at / "cam_params.json").write_text(json.dumps({"camera": lens}))
    found = read_walk(file)[0].lens
    x, y = 7.0, 11.0  # the place of a pixel's centre there
    expected = [(x - lens["cx"]) / lens["fx"], (y - lens["cy"]) / lens["fy"]]
    assert np.abs(found.rays(np.array([[x + 0.5, y + 0.5]])) - expected).max() < 1e-9


def test_frames_that_are_not_there_leave_the_others_their_poses(tmp_path):
    file = semantic_nerf(tmp_path / "office", 50, kept=(3, 40, 17))
    assert [one.name for one in read_walk(file)] == ["rgb_3.png", "rgb_17.png", "rgb_40.png"]
    assert np.abs(read_walk(file)[1].world_from_camera - pose(17)).max() < 1e-12


def test_of_a_long_walk_each_part_gives_one(tmp_path, messages):
    file = semantic_nerf(tmp_path / "office", 90)
    found = import_captures(file.parent, file, CaptureSettings(max_keyframes=9), messages).captures
    numbers = [int(one.name[4:-4]) for one in found]
    assert [number // 10 for number in numbers] == list(range(9)) and len(messages.messages) == 1


def test_what_is_wrong_is_told_by_its_place(tmp_path):
    file = semantic_nerf(tmp_path / "office", 5)
    lines = file.read_text().splitlines()
    for text, where, what in (
        ("\n".join(lines[:3]), "traj_w_c.txt", "rgb_3.png"),
        ("\n".join([*lines[:2], "1 2 3", *lines[3:]]), "line 3", "16"),
        ("\n".join([*lines[:2], lines[2].replace("e", "x", 1), *lines[3:]]), "line 3", "16"),
        ("\n".join([*lines[:2], "nan " * 16, *lines[3:]]), "line 3", "16"),
    ):
        file.write_text(text)
        with refused(CaptureError, where, what):
            read_walk(file)
    file.write_bytes(b"\xff\xfe\x00")
    with refused(CaptureError, "traj_w_c.txt"):
        read_walk(file)
    for frame in (tmp_path / "office/rgb").iterdir():
        frame.unlink()
    with refused(CaptureError, "rgb", "no frames"):
        read_walk(file)
    (tmp_path / "office/rgb").rmdir()
    with refused(CaptureError):
        find_poses(file)


def test_a_lens_that_is_none_is_refused(tmp_path):
    file = nice_slam(tmp_path / "office", 3)
    for told in ({"camera": []}, {"camera": {"w": 120}}, {"camera": {"w": 120, "h": 68, "fx": 0, "fy": 1, "cx": 1}}):
        (tmp_path / "cam_params.json").write_text(json.dumps(told))
        with refused(CaptureError, "", cure=""):
            read_walk(file)


def test_frames_of_another_shape_are_refused(tmp_path):
    file = nice_slam(tmp_path / "office", 3)
    Image.new("RGB", (30, 30)).save(tmp_path / "office/results/frame000001.jpg")
    with refused(CaptureError, "line 2"):
        import_captures(file.parent, file, SETTINGS)
