"""Raw exports of Polycam, written from a room whose geometry is known."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from expected_errors import refused
from measured_points import measured

from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.sparse import triangulate
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import load_image_uint8, save_image

SETTINGS = CaptureSettings()
# ARKit's world: +Y up; here the room is turned and moved in it too.
_TURN = 0.7
ARKIT_FROM_ROOM = np.array(
    [
        [np.cos(_TURN), -np.sin(_TURN), 0.0, 1.0],
        [0.0, 0.0, 1.0, -1.4],
        [-np.sin(_TURN), -np.cos(_TURN), 0.0, 0.5],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
GL = np.diag([1.0, -1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def _cameras(portrait=False):
    """A phone's landscape sensor, at 320 x 240; held upright its rows run up and down."""
    lens = Camera(320, 240, 250.0, 251.0, 158.5, 121.0, np.eye(4))
    places = [(-0.9, -2.3, 1.5), (-0.3, -2.4, 1.55), (0.3, -2.3, 1.5), (0.9, -2.2, 1.45), (1.4, -1.9, 1.6)]
    turn = QUARTER if portrait else np.eye(4)
    return [lens.at(look_at(place, (0.1, 0.6, 0.55)) @ turn) for place in places]


def _camera_json(camera, pose=None):
    matrix = (ARKIT_FROM_ROOM @ camera.world_from_camera if pose is None else pose) @ GL
    numbers = {f"t_{i}{j}": float(matrix[i, j]) for i in range(3) for j in range(4)}
    return numbers | {
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "width": camera.width,
        "height": camera.height,
        "blur_score": 115.28,
        "timestamp": 638443502,
        "neighbors": [],
    }


def _export(folder, room, cameras, corrected=True, depth_factor=1.0):
    """``keyframes`` as the app writes it; corrected images have a black border."""
    keyframes = folder / "keyframes"
    kinds = ("", "corrected_") if corrected else ("",)
    for name in [f"{kind}{what}" for kind in kinds for what in ("images", "cameras")] + ["depth", "confidence"]:
        (keyframes / name).mkdir(parents=True)
    for index, camera in enumerate(cameras):
        stem = str(638443502000 + 999_999 * index)
        image = room.image(camera)
        for kind in kinds:
            bordered = image.copy()
            if kind:
                bordered[:9], bordered[-9:], bordered[:, :9], bordered[:, -9:] = 0, 0, 0, 0
            save_image(keyframes / f"{kind}images" / f"{stem}.png", bordered)
            (keyframes / f"{kind}cameras" / f"{stem}.json").write_text(json.dumps(_camera_json(camera)))
        depth = room.depth(camera.scaled(0.4)) * depth_factor
        wrong = np.zeros(depth.shape, bool)
        wrong[:, :20] = True  # what the sensor is not sure of
        depth = np.where(wrong, 0.3, depth)
        cv2.imwrite(str(keyframes / "depth" / f"{stem}.png"), np.rint(depth * 1000).astype(np.uint16))
        cv2.imwrite(str(keyframes / "confidence" / f"{stem}.png"), np.where(wrong, 0, 255).astype(np.uint8))
    (folder / "mesh_info.json").write_text("{}")
    return keyframes


def _measured(room, captures, cameras, rng):
    """Sparse points of the room in ARKit's frame, as each capture measures them."""
    points = np.concatenate(
        [
            camera.unproject(room.depth(camera)).reshape(-1, 3)[rng.choice(320 * 240, 250, replace=False)]
            for camera in cameras
        ]
    )
    points = points @ ARKIT_FROM_ROOM[:3, :3].T + ARKIT_FROM_ROOM[:3, 3]
    return measured(points, [capture.camera for capture in captures])


@pytest.mark.parametrize("given", ["the export as captures", "keyframes as poses", "the export as poses"])
def test_an_export_is_known_by_its_folders(tmp_path, room, given):
    keyframes = _export(tmp_path, room, _cameras())
    poses = {"keyframes as poses": keyframes, "the export as poses": tmp_path}.get(given)
    imported = import_captures(tmp_path, poses, SETTINGS)
    assert imported.metric and imported.source == "Polycam, optimised poses"
    assert np.array_equal(imported.up, [0, 1, 0]) and imported.depth.folder == keyframes / "depth"
    assert [c.name for c in imported.captures] == sorted(c.name for c in imported.captures)
    for capture, camera in zip(imported.captures, _cameras(), strict=True):
        assert np.abs(capture.camera.world_from_camera - ARKIT_FROM_ROOM @ camera.world_from_camera).max() < 1e-9


def test_the_black_border_of_corrected_images_is_cut_off_exactly(tmp_path, room, rng):
    _export(tmp_path, room, _cameras())
    for capture, camera in zip(import_captures(tmp_path, None, SETTINGS).captures, _cameras(), strict=True):
        assert (capture.camera.width, capture.camera.height) == (290, 210)
        photograph = load_image_uint8(capture.image_path)
        assert np.array_equal(np.rint(capture.image() * 255), photograph[15:-15, 15:-15])
        points = rng.uniform([-1, 0, 0], [1, 1, 1], (50, 3))
        in_photograph, _ = camera.project(points)
        world = points @ ARKIT_FROM_ROOM[:3, :3].T + ARKIT_FROM_ROOM[:3, 3]
        working = capture.working_pixels(in_photograph, (240, 320))
        assert np.abs(capture.camera.project(world)[0] - working).max() < 1e-6
        assert np.abs(capture.photograph_shares(working) * [320, 240] - in_photograph).max() < 1e-6


def test_an_export_without_optimised_poses(tmp_path, room):
    _export(tmp_path, room, _cameras(), corrected=False)
    imported = import_captures(tmp_path, None, SETTINGS)
    assert imported.source == "Polycam, ARKit's poses as recorded"
    assert imported.captures[0].lens is None
    assert (imported.captures[0].camera.width, imported.captures[0].camera.height) == (320, 240)


@pytest.mark.parametrize("portrait", [False, True])
def test_gravity_floor_and_metre_of_an_export(tmp_path, room, rng, portrait, messages):
    """A phone held upright stores sideways photographs: only ARKit knows which way is up."""
    cameras = _cameras(portrait)
    _export(tmp_path, room, cameras, corrected=False)
    imported = import_captures(tmp_path, None, SETTINGS)
    sparse = _measured(room, imported.captures, cameras, rng)
    found = register(imported, sparse, Scale(), SETTINGS, messages)
    assert "floor plane" in found.ground and not messages.warnings
    assert "metric poses (Polycam" in found.scale_source and "sensor depth at" in found.scale_source
    for capture, camera in zip(found.captures(imported.captures), cameras, strict=True):
        assert capture.camera.centre[2] == pytest.approx(camera.centre[2], abs=0.01)
        assert capture.camera.forward[2] == pytest.approx(camera.forward[2], abs=0.01)
    nothing = SparsePoints(
        *(values[:0] for values in (sparse.points, sparse.colours, sparse.visibility, sparse.error_px, sparse.pixels))
    )
    blind = register(imported, nothing, Scale(), SETTINGS, messages)
    assert "measured gravity" in blind.ground
    up = blind.world_from_capture[:3, :3] @ [0, 1, 0]
    assert np.allclose(up, [0, 0, 1])


def test_depth_that_contradicts_the_poses_is_said_and_changes_nothing(tmp_path, room, rng, messages):
    cameras = _cameras()
    keyframes = _export(tmp_path, room, cameras, depth_factor=1.1)
    imported = import_captures(tmp_path, None, SETTINGS)
    sparse = _measured(room, imported.captures, cameras, rng)
    found = register(imported, sparse, Scale(), SETTINGS, messages)
    assert np.cbrt(np.linalg.det(found.world_from_capture[:3, :3])) == pytest.approx(1.0, abs=1e-12)
    assert any("+10.0% larger" in text and "--depth" in text for text in messages.warnings)
    taken = register(imported, sparse, Scale.depth(keyframes / "depth"), SETTINGS, messages)
    assert np.cbrt(np.linalg.det(taken.world_from_capture[:3, :3])) == pytest.approx(1.1, abs=0.005)


def test_hidden_files_and_missing_photographs(tmp_path, room, messages):
    keyframes = _export(tmp_path, room, _cameras())
    first = sorted((keyframes / "corrected_cameras").iterdir())[0]
    (first.parent / f"._{first.name}").write_bytes(b"\x00\x05\x16\x07")
    (keyframes / "corrected_images" / f"{first.stem}.png").unlink()
    assert len(import_captures(tmp_path, None, SETTINGS, messages).captures) == 4
    assert any(first.stem in text for text in messages.warnings)


def test_of_a_long_scan_the_sharpest_of_neighbours_are_taken(tmp_path, room):
    first = _cameras()[0]
    poses = [look_at((-0.9 + 0.1 * i, -2.3, 1.5), (0.1, 0.6, 0.55)) for i in range(12)]
    keyframes = _export(tmp_path, room, [first.at(pose) for pose in poses], corrected=False)
    files = sorted((keyframes / "images").iterdir())
    sharp = {1, 3, 8, 9}
    for index, path in enumerate(files):
        if index not in sharp:
            save_image(path, cv2.GaussianBlur(load_image_uint8(path), (0, 0), 2.0))
    imported = import_captures(tmp_path, None, CaptureSettings(max_keyframes=4))
    assert [capture.image_path for capture in imported.captures] == [files[i] for i in sorted(sharp)]
    assert len(import_captures(tmp_path, None, CaptureSettings(max_keyframes=12)).captures) == 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t_12": None}, "'t_12' is missing"),
        ({"t_12": "north"}, "'t_12' is 'north'"),
        ({"t_12": 7.0}, "not a rotation"),
        ({"fx": -1.0}, "'fx' is -1.0"),
        ({"width": 240, "height": 320}, "its camera 240x320"),
    ],
)
def test_what_is_wrong_with_an_export_is_said(tmp_path, room, change, message):
    keyframes = _export(tmp_path, room, _cameras())
    path = sorted((keyframes / "corrected_cameras").iterdir())[2]
    data = json.loads(path.read_text()) | change
    path.write_text(json.dumps({key: value for key, value in data.items() if value is not None}))
    with pytest.raises(CaptureError, match=message) as caught:
        import_captures(tmp_path, None, SETTINGS)
    assert path.name in str(caught.value)


def test_an_export_without_cameras(tmp_path):
    for name in ("cameras", "images"):
        (tmp_path / "keyframes" / name).mkdir(parents=True)
    with refused(CaptureError, "keyframes/cameras"):
        import_captures(tmp_path, None, SETTINGS)


@pytest.mark.slow
def test_an_export_from_its_files_to_the_world(tmp_path, room):
    """Features, triangulation and all: what `r2sego new` does with the folder."""
    cameras = _cameras()
    _export(tmp_path, room, cameras)
    imported = import_captures(tmp_path, None, SETTINGS)
    sparse = triangulate(imported.captures, SETTINGS)
    found = register(imported, sparse, Scale(), SETTINGS)
    for capture, camera in zip(found.captures(imported.captures), cameras, strict=True):
        assert capture.camera.centre[2] == pytest.approx(camera.centre[2], abs=0.01)
