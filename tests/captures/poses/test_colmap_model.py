"""COLMAP models as COLMAP 4 writes them: rigs and frames, several cameras, parts, damage."""

from __future__ import annotations

import os
import struct
import time
import tracemalloc

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.colmap_files import (
    check_cameras,
    check_cameras_text,
    check_images,
    check_images_text,
)
from r2sego_blender.captures.poses.colmap_model import read_colmap_model
from r2sego_blender.captures.poses.colmap_points import read_colmap_points
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError

pycolmap = pytest.importorskip("pycolmap")

SETTINGS = CaptureSettings()
PARAMETERS = {1: [50.0, 52.0, 31.0, 22.0], 2: [40.0, 20.0, 16.0, 0.03]}


def _rigid(pose):
    inverse = np.linalg.inv(pose)
    return pycolmap.Rigid3d(pycolmap.Rotation3d(inverse[:3, :3]), inverse[:3, 3])


def _rig_model(folder, rng, binary=True, frames=3):
    """A rig of two cameras of different models, moved together; returns name -> pose."""
    solved = pycolmap.Reconstruction()
    solved.add_camera(pycolmap.Camera(model="PINHOLE", width=64, height=48, params=PARAMETERS[1], camera_id=1))
    solved.add_camera(pycolmap.Camera(model="SIMPLE_RADIAL", width=40, height=32, params=PARAMETERS[2], camera_id=2))
    rig_from_second = look_at(np.array([0.1, 0.02, 0.0]), np.array([0.3, 0.1, 1.0]), up=(0, -1, 0))
    rig = pycolmap.Rig(rig_id=1)
    rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 1))
    rig.add_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 2), _rigid(rig_from_second))
    solved.add_rig(rig)
    poses = {}
    for index in range(frames):
        pose = look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3))
        frame = pycolmap.Frame(frame_id=index + 1, rig_id=1)
        images = [pycolmap.Image(name=f"cam{k}/{index:03d}.png", camera_id=k, image_id=10 * index + k) for k in (1, 2)]
        for image in images:
            frame.add_data_id(image.data_id)
        frame.rig_from_world = _rigid(pose)
        solved.add_frame(frame)
        for image in images:
            image.frame_id = frame.frame_id
            solved.add_image(image)
        solved.register_frame(frame.frame_id)
        poses |= {images[0].name: pose, images[1].name: pose @ rig_from_second}
    folder.mkdir(parents=True)
    (solved.write_binary if binary else solved.write_text)(folder)
    return poses


def _photographs(folder, blank_photograph, frames=3):
    for index in range(frames):
        blank_photograph(folder / "cam1" / f"{index:03d}.png", 64, 48)
        blank_photograph(folder / "cam2" / f"{index:03d}.png", 40, 32)


@pytest.mark.parametrize("binary", [True, False])
def test_rigs_of_several_cameras(tmp_path, rng, blank_photograph, binary):
    poses = _rig_model(tmp_path / "sparse", rng, binary)
    assert (tmp_path / "sparse" / ("rigs.bin" if binary else "rigs.txt")).is_file()
    _photographs(tmp_path / "images", blank_photograph)
    captures = import_captures(tmp_path / "images", tmp_path, SETTINGS).captures
    assert {capture.name for capture in captures} == set(poses)
    for capture in captures:
        assert np.abs(capture.camera.world_from_camera - poses[capture.name]).max() < 1e-9
        focal = PARAMETERS[1][:2] if capture.name.startswith("cam1") else PARAMETERS[2][:1] * 2
        assert [capture.camera.fx, capture.camera.fy] == focal


def test_damaged_rigs_and_frames_are_not_needed(tmp_path, rng, blank_photograph):
    poses = _rig_model(tmp_path / "sparse", rng)
    for name in ("rigs.bin", "frames.bin", "points3D.bin"):
        (tmp_path / "sparse" / name).write_bytes(rng.bytes(500))
    _photographs(tmp_path / "images", blank_photograph)
    assert len(import_captures(tmp_path / "images", tmp_path, SETTINGS).captures) == len(poses)


def test_photographs_that_are_missing_are_left_out_and_named(tmp_path, rng, blank_photograph, messages):
    _rig_model(tmp_path / "sparse", rng)
    _photographs(tmp_path / "images", blank_photograph)
    (tmp_path / "images" / "cam2" / "001.png").unlink()
    captures = import_captures(tmp_path / "images", tmp_path, SETTINGS, messages).captures
    assert len(captures) == 5
    assert any("1 of the 6" in text and "cam2/001.png" in text for text in messages.warnings)
    for name in ("000.png", "001.png", "002.png"):
        (tmp_path / "images" / "cam1" / name).unlink()
    with refused(CaptureError, "sparse", "4 of the 6", "cam1/000.png"):
        import_captures(tmp_path / "images", tmp_path, SETTINGS)


def test_one_cameras_folder_is_never_taken_for_anothers(tmp_path, rng, blank_photograph, messages):
    """cam1/000.png and cam2/000.png: given the folder cam1 alone, neither camera is meant by 000.png."""
    _rig_model(tmp_path / "sparse", rng)
    _photographs(tmp_path / "images", blank_photograph)
    with refused(CaptureError, "sparse", "6 of the 6"):
        import_captures(tmp_path / "images" / "cam1", tmp_path / "sparse", SETTINGS)


@pytest.mark.parametrize(("binary", "line_end"), [(True, "\n"), (False, "\n"), (False, "\r\n")])
def test_names_with_spaces_are_read_whole(tmp_path, rng, blank_photograph, messages, binary, line_end):
    """``NAME`` is the rest of the line, of which COLMAP's own reader takes the first word."""
    poses = _rig_model(tmp_path / "model", rng, binary)
    solved = pycolmap.Reconstruction(tmp_path / "model")
    names = {name: f"Living room {i}/Room {i}  ({name[3]}) a.png" for i, name in enumerate(sorted(poses))}
    names["cam2/002.png"] = "plain.png"
    for image in solved.images.values():
        image.name = names[image.name]
    (solved.write_binary if binary else solved.write_text)(tmp_path / "model")
    if not binary:
        path = tmp_path / "model" / "images.txt"
        path.write_bytes(path.read_bytes().replace(b"\n", line_end.encode()))
    for name, renamed in names.items():
        blank_photograph(tmp_path / "images" / renamed, *((64, 48) if name.startswith("cam1") else (40, 32)))
    captures = import_captures(tmp_path / "images", tmp_path / "model", SETTINGS, messages).captures
    assert messages.warnings == []
    renamed_poses = {names[name].rpartition("/")[2]: pose for name, pose in poses.items()}
    assert {capture.name for capture in captures} == set(renamed_poses)
    for capture in captures:
        assert np.abs(capture.camera.world_from_camera - renamed_poses[capture.name]).max() < 1e-9


def test_models_without_points(tmp_path, rng):
    _rig_model(tmp_path / "sparse", rng)
    (tmp_path / "sparse" / "points3D.bin").unlink()
    assert read_colmap_points(tmp_path / "sparse") is None


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_points_cut_short_or_garbled_are_told_at_once(tmp_path_factory, data):
    """COLMAP itself takes 25 s and 8 GB over such a file."""
    folder = tmp_path_factory.mktemp("model")
    count = data.draw(st.integers(1, 5))
    record = struct.pack("<Q3d3BdQ", 1, 1.0, 2.0, 3.0, 9, 8, 7, 0.5, 2) + struct.pack("<4I", 1, 0, 2, 0)
    whole = struct.pack("<Q", count) + record * count
    (folder / "points3D.bin").write_bytes(whole)
    assert read_colmap_points(folder)[0].tolist() == [[1.0, 2.0, 3.0]] * count
    cut = data.draw(st.integers(0, len(whole) - 1))
    (folder / "points3D.bin").write_bytes(whole[:cut])
    with refused(CaptureError, "points3D.bin"):
        read_colmap_points(folder)


@pytest.fixture(scope="module")
def images_bin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "sparse"
    _rig_model(folder, np.random.default_rng(1))
    return (folder / "images.bin").read_bytes()


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_images_cut_short_or_with_wrong_counts_never_reach_colmap(tmp_path_factory, images_bin, data):
    path = tmp_path_factory.mktemp("cut") / "images.bin"
    path.write_bytes(images_bin)
    check_images(path)
    damage = data.draw(st.sampled_from(["cut", "longer", "count", "measurements"]))
    spoilt = bytearray(images_bin)
    if damage == "cut":
        spoilt = spoilt[: data.draw(st.integers(0, len(spoilt) - 1))]
    elif damage == "longer":
        spoilt += data.draw(st.binary(min_size=1, max_size=40))
    elif damage == "count":
        count = data.draw(st.integers(0, 2**64 - 1).filter(lambda n: n != 6))
        spoilt[:8] = struct.pack("<Q", count)
    else:
        spoilt[-8:] = struct.pack("<Q", data.draw(st.integers(1, 2**64 - 1)))
    path.write_bytes(spoilt)
    with refused(CaptureError, "images.bin"):
        check_images(path)


@pytest.mark.parametrize("damage", ["half", "longer", "model", "focal"])
def test_damaged_cameras_are_refused(tmp_path, rng, blank_photograph, damage):
    _rig_model(tmp_path / "sparse", rng)
    _photographs(tmp_path / "images", blank_photograph)
    path = tmp_path / "sparse" / "cameras.bin"
    data = bytearray(path.read_bytes())
    if damage == "half":
        data = data[: len(data) // 2]
    elif damage == "longer":
        data += bytes(8)
    elif damage == "model":
        data[12:16] = struct.pack("<i", 99)
    else:
        data[32:40] = struct.pack("<d", float("nan"))
    path.write_bytes(data)
    with pytest.raises(CaptureError, match=r"cameras\.bin|COLMAP model"):
        read_colmap_model(tmp_path / "sparse", tmp_path / "images")


def _cut(path, kept):
    """Keep the first ``kept`` lines; of a fraction also that share of the next one."""
    lines = path.read_text().split("\n")
    whole, part = int(kept), kept - int(kept)
    cut = lines[whole][: int(part * len(lines[whole]))]
    path.write_text("\n".join(lines[:whole]) + "\n" + cut)


@pytest.mark.parametrize(
    ("name", "kept", "words"),
    [
        ("images.txt", 8, r"its comment announces 6 images, and 2 are there"),
        ("images.txt", 9, r"line 9 is an image without its line of measurements"),
        ("images.txt", 8.5, r"line 9 is an image without its line of measurements"),
        ("images.txt", 3, None),
        ("cameras.txt", 4, r"its comment announces 2 cameras, and 1 are there"),
        ("cameras.txt", 4.9, r"line 5 is cut off"),
    ],
)
def test_texts_that_were_cut_off_are_told(tmp_path, rng, blank_photograph, name, kept, words):
    _rig_model(tmp_path / "sparse", rng, binary=False)
    _photographs(tmp_path / "images", blank_photograph)
    assert len(read_colmap_model(tmp_path / "sparse", tmp_path / "images")) == 6
    _cut(tmp_path / "sparse" / name, kept)
    if words is None:
        assert read_colmap_model(tmp_path / "sparse", tmp_path / "images") == []
        return
    with pytest.raises(CaptureError, match=rf"{name}: {words}.* Export or copy"):
        read_colmap_model(tmp_path / "sparse", tmp_path / "images")


@pytest.mark.parametrize(
    ("between", "end", "words"),
    [
        ("\n\n", "\n\n", None),
        ("\n0.5 1.5 -1 2 3 4\n", "\n0.5 1.5 -1", None),
        ("\n\n", "\n", r"line 11 is an image without its line of measurements"),
        ("\n\n", "", r"line 11 is an image without its line of measurements"),
        ("\n", "\n", r"line 2 is not the measurements of the image before it"),
    ],
)
def test_of_images_that_another_program_wrote_none_is_lost(tmp_path, rng, blank_photograph, between, end, words):
    """COLMAP reads five of six, and of poses alone every other one, without a word."""
    _rig_model(tmp_path / "sparse", rng, binary=False)
    _photographs(tmp_path / "images", blank_photograph)
    path = tmp_path / "sparse" / "images.txt"
    poses = [line for line in path.read_text().splitlines() if line.endswith(".png")]
    path.write_text(between.join(poses) + end)
    if words is None:
        assert len(read_colmap_model(tmp_path / "sparse", tmp_path / "images")) == 6
        return
    with pytest.raises(CaptureError, match=rf"images\.txt: {words}"):
        read_colmap_model(tmp_path / "sparse", tmp_path / "images")


@pytest.mark.parametrize("kept", [4, 4.95, 3])
def test_points_in_a_text_that_was_cut_off_are_told(tmp_path, kept):
    path = tmp_path / "points3D.txt"
    head = "# 3D point list with one line of data per point:\n#   POINT3D_ID, X, Y, Z\n"
    points = "".join(f"{k} {k}.5 2 3 9 8 7 0.25 1 {k} 2 {k}\n" for k in range(2))
    path.write_text(f"{head}# Number of points: 2, mean track length: 2\n{points}")
    assert read_colmap_points(tmp_path)[0].tolist() == [[0.5, 2.0, 3.0], [1.5, 2.0, 3.0]]
    _cut(path, kept)
    with refused(CaptureError, "points3D.txt", cure="Export or copy the COLMAP model again"):
        read_colmap_points(tmp_path)


@pytest.mark.parametrize("number", ["1e38", "1e308", "nan", "inf"])
@pytest.mark.parametrize("word", [1, 6])
def test_a_pose_that_is_none_is_named(tmp_path, rng, blank_photograph, number, word):
    """COLMAP normalises a quaternion whatever it is, to numbers of which none is one."""
    _rig_model(tmp_path / "sparse", rng, binary=False)
    _photographs(tmp_path / "images", blank_photograph)
    path = tmp_path / "sparse" / "images.txt"
    lines = path.read_text().split("\n")
    index = next(index for index, line in enumerate(lines) if line.endswith(".png"))
    words = lines[index].split()
    words[word] = number
    path.write_text("\n".join([*lines[:index], " ".join(words), *lines[index + 1 :]]))
    with pytest.raises(CaptureError, match=r"images\.txt|COLMAP model"):
        import_captures(tmp_path / "images", tmp_path, SETTINGS)


@pytest.mark.parametrize("count", [100_001, 2**40, 2**64 - 1])
@pytest.mark.parametrize(("name", "check"), [("cameras.bin", check_cameras), ("images.bin", check_images)])
def test_more_records_than_a_file_has_room_for_take_no_time(tmp_path, name, check, count):
    path = tmp_path / name
    path.write_bytes(struct.pack("<Q", count) + bytes(1 << 20))
    started = time.process_time()
    with refused(CaptureError, name):
        check(path)
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize(("name", "check"), [("cameras.txt", check_cameras_text), ("images.txt", check_images_text)])
def test_a_line_without_an_end_is_refused(tmp_path, name, check):
    path = tmp_path / name
    path.write_text("1 2 3 " * (2 << 20))
    with refused(CaptureError, name, "has no end"):
        check(path)


def test_text_of_points_takes_ten_times_its_size_at_most(tmp_path):
    path = tmp_path / "points3D.txt"
    path.write_text("1 1 1 1 0 0 0 0\n" * 200_000 + "\n" * 2_000_000)
    tracemalloc.start()
    points, _ = read_colmap_points(tmp_path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(points) == 200_000
    assert peak < 10 * path.stat().st_size


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin"])
def test_a_pipe_is_no_model(tmp_path, name):
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    os.mkfifo(tmp_path / name)
    with refused(CaptureError, name):
        (check_cameras if name == "cameras.bin" else check_images)(tmp_path / name)
