"""Metres from sensor depth: maps of every format, ratios with a known truth, and bad ones."""

from __future__ import annotations

import dataclasses
import json

import cv2
import numpy as np
import OpenEXR
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from measured_points import measured
from PIL import Image
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frame.depth_scale import depth_scale
from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import Imported, import_captures
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.captures.poses.photographs import Photograph, capture_of
from r2sego_blender.captures.sensors.sensor_depth import SensorDepth
from r2sego_blender.captures.sparse import triangulate
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError

SETTINGS = CaptureSettings()


def _write(path, depth_m, kind="png"):
    path.parent.mkdir(parents=True, exist_ok=True)
    if kind in ("png", "tif"):
        cv2.imwrite(str(path.with_suffix(f".{kind}")), np.rint(depth_m * 1000).astype(np.uint16))
    elif kind == "exr":
        image = OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": depth_m.astype(np.float32)})
        image.write(str(path.with_suffix(".exr")))
    elif kind == "npy":
        np.save(path.with_suffix(".npy"), depth_m.astype(np.float64))
    elif kind == "npy in mm":
        np.save(path.with_suffix(".npy"), np.rint(depth_m * 1000).astype(np.uint16))
    else:
        np.savez_compressed(path.with_suffix(".npz"), other=np.zeros(3), depth=depth_m)


def _sparse(room, cameras, rng, noise_px=0.5, count=400):
    """Points of the room's surface, measured by every camera that sees them."""
    chosen = []
    for camera in cameras:
        surface = camera.unproject(room.depth(camera)).reshape(-1, 3)
        chosen.append(surface[rng.choice(len(surface), count // len(cameras), replace=False)])
    exact = measured(np.concatenate(chosen), cameras, margin_px=2.0)
    noise = rng.normal(0, noise_px, exact.pixels.shape).astype(np.float32)
    return dataclasses.replace(exact, pixels=exact.pixels + noise)


def _scaled(captures, sparse, scale):
    similarity = np.diag([scale, scale, scale, 1.0])
    similarity[:3, 3] = 1.0, -2.0, 3.0
    return tuple(c.transformed(similarity) for c in captures), sparse.transformed(similarity)


@pytest.mark.parametrize("kind", ["png", "tif", "exr", "npy", "npy in mm", "npz"])
def test_depth_of_every_format_tells_the_scale(tmp_path, rng, room, room_cameras, room_captures, kind):
    for capture in room_captures:
        _write(tmp_path / capture.name, room.depth(capture.camera.scaled(0.64)), kind)  # 256 x 192
    captures, sparse = _scaled(room_captures, _sparse(room, room_cameras, rng), 2.5)
    found = depth_scale(captures, sparse, SensorDepth(tmp_path))
    assert found.metres_per_unit * 2.5 == pytest.approx(1.0, abs=0.004)
    assert found.spread < 0.01 and found.uncertainty < 0.005 and found.captures == 5


def test_maps_of_one_name_are_told_apart(tmp_path, rng, room, room_cameras, room_captures):
    names = ["left/0.png", "right/0.png", "1.png", "1.jpg", "2.png"]
    captures = [dataclasses.replace(c, name=name) for c, name in zip(room_captures, names, strict=True)]
    for capture, stem in zip(captures, ("left_0.png", "right_0.png", "1.png", "1.jpg", "2"), strict=True):
        np.save(tmp_path / f"{stem}.npy", room.depth(capture.camera))
    np.save(tmp_path / "0.npy", 9.0 * room.depth(captures[0].camera))  # of either, so of neither
    found = depth_scale(captures, _sparse(room, room_cameras, rng), SensorDepth(tmp_path))
    assert found.captures == 5 and found.spread < 0.01


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.02, 50.0), wrong=st.floats(0.0, 0.3), noise=st.floats(0.0, 0.03))
def test_noise_and_wrong_depths_leave_the_scale(
    tmp_path_factory, room, room_cameras, room_captures, seed, scale, wrong, noise
):
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("depth")
    for capture in room_captures:
        depth = room.depth(capture.camera.scaled(0.32))
        depth *= 1 + cv2.GaussianBlur(rng.normal(0, 1, depth.shape), (0, 0), 6) * noise * 15
        patch = rng.random((6, 8)) < wrong  # whole patches at a depth of their own, some unknown
        factor = np.where(patch, rng.choice([0.0, 0.6, 1.7], patch.shape), 1.0)
        _write(folder / capture.name, depth * cv2.resize(factor, depth.shape[::-1], interpolation=0))
    captures, sparse = _scaled(room_captures, _sparse(room, room_cameras, rng), scale)
    found = depth_scale(captures, sparse, SensorDepth(folder))
    assert found.metres_per_unit * scale == pytest.approx(1.0, abs=0.012 + noise)
    assert abs(found.metres_per_unit * scale - 1.0) < 5 * found.uncertainty + 0.004


def test_the_registration_says_how_sure_it_is(tmp_path, rng, room, room_cameras, room_captures):
    for capture in room_captures:
        _write(tmp_path / capture.name, room.depth(capture.camera))
    captures, sparse = _scaled(room_captures, _sparse(room, room_cameras, rng), 0.2)
    found = register(Imported(captures, "test", False), sparse, Scale.depth(tmp_path), SETTINGS)
    assert np.cbrt(np.linalg.det(found.world_from_capture[:3, :3])) == pytest.approx(5.0, rel=0.005)
    assert "sensor depth at" in found.scale_source and "spread" in found.scale_source


def test_depth_seen_through_a_lens_that_distorts(tmp_path, rng, room, room_bounds, room_cameras):
    lens = Lens(400, 300, 300.0, 310.0, 190.0, 156.0, (-0.2, 0.05, 0.003, -0.002))
    captures = [
        Capture(f"{i}.jpg", None, lens.straight(camera.world_from_camera), lens)
        for i, camera in enumerate(room_cameras)
    ]
    y, x = np.mgrid[:150, :200]
    rays = lens.rays(np.stack([2 * x + 1.0, 2 * y + 1.0], axis=-1).reshape(-1, 2))
    for capture in captures:
        pose = capture.camera.world_from_camera
        turned = np.column_stack([rays, np.ones(len(rays))]) @ pose[:3, :3].T
        reach = [(bound - pose[:3, 3]) / turned for bound in room_bounds]
        _write(tmp_path / capture.name, np.maximum(*reach).min(axis=1).reshape(150, 200), "npy")
    sparse = _sparse(room, [capture.camera for capture in captures], rng, noise_px=0.0)
    assert depth_scale(captures, sparse, SensorDepth(tmp_path)).metres_per_unit == pytest.approx(1, abs=5e-4)


def test_depth_that_is_not_sure_is_not_believed(tmp_path, rng, room, room_cameras, room_captures):
    for capture in room_captures:
        depth = room.depth(capture.camera)
        low = rng.random((30, 40)) < 0.6
        low = cv2.resize(low.astype(np.uint8), (400, 300), interpolation=cv2.INTER_NEAREST) > 0
        _write(tmp_path / "depth" / capture.name, np.where(low, 2.0 * depth, depth))
        (tmp_path / "confidence").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "confidence" / capture.name), np.where(low, 0, 255).astype(np.uint8))
    sparse = _sparse(room, room_cameras, rng)
    found = depth_scale(room_captures, sparse, SensorDepth.beside(tmp_path / "depth"))
    assert found.metres_per_unit == pytest.approx(1.0, abs=0.004)
    near = SensorDepth(tmp_path / "depth", tmp_path / "confidence", range_m=3.0)
    assert 0 < near.of(room_captures[0], "photo0").max() <= 3.0


@pytest.mark.parametrize(
    ("orientation", "shape", "quarter_turns"),
    [(6, (24, 32), -1), (3, (24, 32), 2), (6, (32, 32), -1), (8, (32, 32), 1), (1, (24, 32), 0)],
)
def test_depth_is_turned_upright_with_its_photograph(tmp_path, rng, orientation, shape, quarter_turns):
    """Also where the shape does not tell: upside down, and square; and for the bundle's upright images."""
    exif = Image.Exif()
    exif[274] = orientation
    stored = np.zeros((2 * shape[0], 2 * shape[1], 3), np.uint8)
    Image.fromarray(stored).save(tmp_path / "a.png", exif=exif)
    depth = rng.uniform(1, 3, shape).astype(np.float32)
    np.save(tmp_path / "a.npy", depth)
    (tmp_path / "depth").mkdir()
    (tmp_path / "a.npy").rename(tmp_path / "depth" / "a.npy")
    upright = np.rot90(depth, quarter_turns)
    height, width = 2 * upright.shape[0], 2 * upright.shape[1]
    lens = Lens(width, height, 50.0, 50.0, width / 2, height / 2)
    capture = capture_of(Photograph("a.png", tmp_path / "a.png", lens, np.eye(4), "test"), 640)
    save_captures(tmp_path / "bundle", [capture])
    for one in (capture, *load_captures(tmp_path / "bundle")):
        assert np.array_equal(SensorDepth(tmp_path / "depth").of(one, "a"), upright)


def test_depth_that_is_upright_already_is_not_turned(tmp_path, rng):
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / "a.png", exif=exif)
    (tmp_path / "depth").mkdir()
    depth = rng.uniform(1, 3, (32, 24)).astype(np.float32)
    np.save(tmp_path / "depth" / "a.npy", depth)
    lens = Lens(48, 64, 50.0, 50.0, 24.0, 32.0)
    capture = capture_of(Photograph("a.png", tmp_path / "a.png", lens, np.eye(4), "test"), 640)
    assert np.array_equal(SensorDepth(tmp_path / "depth").of(capture, "a"), depth)


@pytest.mark.parametrize("content", [b"", b"\x89PNG garbage", b"\x93NUMPY\x01\x00", b"PK\x03\x04 cut"])
@pytest.mark.parametrize("suffix", ["png", "npy", "npz", "exr"])
def test_damaged_depth_maps_are_named(tmp_path, room_captures, content, suffix):
    path = tmp_path / f"photo0.{suffix}"
    path.write_bytes(content)
    with refused(CaptureError, f"photo0.{suffix}"):
        SensorDepth(tmp_path).of(room_captures[0], "photo0")


def test_maps_that_cannot_be_depth_are_refused(tmp_path, rng, room, room_cameras, room_captures):
    sparse = _sparse(room, room_cameras, rng)
    with refused(CaptureError, tmp_path / "no"):
        SensorDepth.beside(tmp_path / "no")
    with refused(CaptureError, tmp_path, "0 points were measured in 0 depth maps of 5"):
        depth_scale(room_captures, sparse, SensorDepth(tmp_path))
    cv2.imwrite(str(tmp_path / "photo0.png"), np.full((30, 40), 200, np.uint8))
    with refused(CaptureError, "photo0.png", "8 bits"):
        depth_scale(room_captures, sparse, SensorDepth(tmp_path))
    np.save(tmp_path / "photo0.npy", np.ones((40, 30), np.float32))
    (tmp_path / "photo0.png").unlink()
    with refused(CaptureError, "photo0.npy", "30x40, its photograph 400x300"):
        depth_scale(room_captures, sparse, SensorDepth(tmp_path))
    for capture in room_captures:
        _write(tmp_path / capture.name, rng.uniform(0.5, 5.0) * np.ones((30, 40)))
    (tmp_path / "photo0.npy").unlink()
    with refused(CaptureError, tmp_path, "disagree"):
        depth_scale(room_captures, sparse, SensorDepth(tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 20, 40])
def test_a_real_offices_depth_tells_its_metre(shared, first):
    """Poses of HoloLens in metres, put in another unit; six photographs from among 63."""
    folder = shared("captures/holo_office")
    matrix = np.loadtxt(folder / "K.txt")
    poses = np.loadtxt(folder / "poses_c2w.txt").reshape(-1, 4, 4)
    paths = sorted((folder / "images").glob("*.png"))
    lens = Camera(540, 360, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], np.eye(4))
    unit = np.diag([0.3, 0.3, 0.3, 1.0])
    captures = [
        Capture(paths[i].name, paths[i], lens.at(poses[i]).transformed(unit)) for i in range(first, first + 12, 2)
    ]
    found = depth_scale(captures, triangulate(captures, SETTINGS), SensorDepth(folder / "depth"))
    assert found.metres_per_unit * 0.3 == pytest.approx(1.0, abs=0.015)
    assert abs(found.metres_per_unit * 0.3 - 1.0) < 2 * found.uncertainty


def _transforms(folder, captures, maps_m, unit_m, said=True, **more):
    """A nerfstudio file of the captures with depth maps of whole numbers of ``unit_m``."""
    frames = []
    for index, (capture, depth_m) in enumerate(zip(captures, maps_m, strict=True)):
        (folder / "images").mkdir(exist_ok=True)
        (folder / "images" / f"{index}.png").write_bytes(capture.image_path.read_bytes())
        _write(folder / "d" / f"frame_{index}", depth_m * 0.001 / unit_m)
        pose = capture.camera.world_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0])
        named = {"depth_file_path": f"d/frame_{index}.png"}
        frames.append({"file_path": f"images/{index}.png", "transform_matrix": pose.tolist(), **named})
    lens = captures[0].camera
    data = {"fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy, "w": lens.width, "h": lens.height}
    unit = {"depth_unit_scale_factor": unit_m} if said else {}
    (folder / "transforms.json").write_text(json.dumps({**data, **unit, **more, "frames": frames}))
    return folder / "transforms.json"


def test_depth_that_transforms_json_names_tells_the_scale(tmp_path, rng, room, room_cameras, room_captures, messages):
    captures, sparse = _scaled(room_captures, _sparse(room, room_cameras, rng), 2.5)
    file = _transforms(tmp_path, captures, [room.depth(camera) for camera in room_cameras], 1 / 4000)
    imported = import_captures(tmp_path, file, SETTINGS, messages)
    assert imported.depth is not None and not imported.metric
    found = register(imported, sparse, Scale.automatic(), SETTINGS, messages)
    assert np.cbrt(np.linalg.det(found.world_from_capture[:3, :3])) == pytest.approx(0.4, rel=0.005)


def test_maps_that_are_named_but_missing_are_told_and_the_others_count(tmp_path, room, room_captures, messages):
    file = _transforms(tmp_path, room_captures, [room.depth(c.camera) for c in room_captures], 0.001, said=False)
    (tmp_path / "d" / "frame_2.png").unlink()
    depth = import_captures(tmp_path, file, SETTINGS, messages).depth
    there = [depth.of(capture, "") is not None for capture in import_captures(tmp_path, file, SETTINGS).captures]
    assert there == [True, True, False, True, True]
    assert any("1 of the 5" in text for text in messages.warnings)


@pytest.mark.parametrize("unit_m", [1 / 5000, 1 / 6553.5, 1 / 256])
def test_depth_in_another_unit_than_poses_in_metres_is_refused_with_the_unit(
    tmp_path, rng, room, room_cameras, room_captures, unit_m
):
    for capture in room_captures:
        _write(tmp_path / capture.name, room.depth(capture.camera) * (0.001 / unit_m))
    sparse = _sparse(room, room_cameras, rng)
    imported = Imported(tuple(room_captures), "test", True)
    with refused(CaptureError, tmp_path, cure=f"--depth-unit {unit_m:.6g}"):
        register(imported, sparse, Scale.depth(tmp_path), SETTINGS)
    found = register(imported, sparse, Scale.depth(tmp_path, unit_m), SETTINGS)
    assert np.cbrt(np.linalg.det(found.world_from_capture[:3, :3])) == pytest.approx(1.0, rel=0.01)


def test_cameras_as_high_as_nobody_holds_them_are_told_with_the_unit(
    tmp_path, rng, room, room_cameras, room_captures, messages
):
    for capture in room_captures:
        _write(tmp_path / capture.name, room.depth(capture.camera) * 5.0)
    captures, sparse = _scaled(room_captures, _sparse(room, room_cameras, rng), 1.7)
    imported = Imported(tuple(captures), "test", False)
    register(imported, sparse, Scale.depth(tmp_path), SETTINGS, messages)
    assert any("--depth-unit 0.0002" in text for text in messages.warnings)
    quiet = ProgressRecorder()
    register(imported, sparse, Scale.depth(tmp_path, 1 / 5000), SETTINGS, quiet)
    assert not any("--depth-unit" in text for text in quiet.warnings)
