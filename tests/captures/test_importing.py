"""Pose files of every format, written and read back, and what is wrong with them."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from cameras_file import save_cameras_json
from expected_errors import refused
from PIL import Image

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.importing import Choice, import_captures
from r2sego_blender.captures.lenses.distortion import COEFFICIENTS
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.captures.poses.colmap_files import find_models
from r2sego_blender.captures.poses.photographs import Photograph, posed_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

SETTINGS = CaptureSettings()
GL = np.diag([1.0, -1.0, -1.0, 1.0])


def _poses(rng, count):
    return [look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3)) for _ in range(count)]


def _photographs(tmp_path, blank_photograph, count=4, width=64, height=48):
    return [blank_photograph(tmp_path / "images" / f"p{i}.png", width, height) for i in range(count)]


def _transforms(tmp_path, poses, top, frames=None):
    listed = [
        {"file_path": f"images/p{i}.png", "transform_matrix": (pose @ GL).tolist()} | (frames[i] if frames else {})
        for i, pose in enumerate(poses)
    ]
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(top | {"frames": listed}))
    return path


def test_transforms_json_with_shared_intrinsics(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    poses = _poses(rng, 4)
    path = _transforms(tmp_path, poses, {"fl_x": 50.0, "fl_y": 55.0, "cx": 30.0, "cy": 25.5, "w": 64, "h": 48})
    imported = import_captures(tmp_path, path, SETTINGS)
    assert [c.name for c in imported.captures] == ["p0.png", "p1.png", "p2.png", "p3.png"]
    assert not imported.metric and imported.source == "transforms.json"
    for capture, pose in zip(imported.captures, poses, strict=True):
        assert np.abs(capture.camera.world_from_camera - pose).max() < 1e-9
        c = capture.camera
        assert (c.fx, c.fy, c.cx, c.cy, c.width, c.height) == (50.0, 55.0, 30.0, 25.5, 64, 48)


def test_the_first_photographs_are_those_that_the_poses_list_first(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph, count=5)
    poses = _poses(rng, 5)
    path = _transforms(tmp_path, poses, {"fl_x": 50.0, "w": 64, "h": 48})
    listed = json.loads(path.read_text())
    listed["frames"] = [listed["frames"][i] for i in (3, 0, 4, 1, 2)]
    path.write_text(json.dumps(listed))
    for first in (3, 4, 5):
        captures = import_captures(tmp_path, path, SETTINGS, choice=Choice(first=first)).captures
        assert [c.name for c in captures] == ["p3.png", "p0.png", "p4.png", "p1.png", "p2.png"][:first]
        for capture, index in zip(captures, (3, 0, 4, 1, 2), strict=False):
            assert np.abs(capture.camera.world_from_camera - poses[index]).max() < 1e-9


@pytest.mark.parametrize("first", [1, 2])
def test_fewer_than_three_first_photographs_are_refused_at_once(first):
    with refused(CaptureError, "--first", str(first), "3"):
        Choice(first=first)


def test_of_photographs_with_poses_that_are_no_images_all_are_counted(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    path = _transforms(tmp_path, _poses(rng, 4), {"fl_x": 50.0, "w": 64, "h": 48})
    for name in ("p1.png", "p3.png"):
        (tmp_path / "images" / name).write_bytes(b"")
    with refused(CaptureError, tmp_path / "images" / "p1.png", "1 more of the 4", "p3.png"):
        import_captures(tmp_path, path, SETTINGS)


def test_of_many_photographs_with_poses_those_are_taken_that_are_asked_for(tmp_path, rng, room, messages):
    cameras = [
        Camera(160, 120, 130.0, 130.0, 80.0, 60.0, look_at((0.2 * i - 1.0, -2.3, 1.5), (0.1, 0.6, 0.6)))
        for i in range(10)
    ]
    (tmp_path / "images").mkdir()
    for i, camera in enumerate(cameras):
        image = cv2.GaussianBlur(room.image(camera), (0, 0), 3.0) if i % 3 == 1 else room.image(camera)
        save_image(tmp_path / "images" / f"p{i}.png", image)
    poses = [camera.world_from_camera for camera in cameras]
    path = _transforms(tmp_path, poses, {"fl_x": 130.0, "w": 160, "h": 120})
    for choice, wanted in (
        (Choice(), set(range(10))),
        (Choice(("p7.png", "p1.png", "p2.png")), {1, 2, 7}),
        (Choice(keyframes=5), None),
        (Choice(keyframes=11), set(range(10))),
    ):
        captures = import_captures(tmp_path, path, SETTINGS, messages, choice).captures
        numbers = [int(capture.name[1]) for capture in captures]
        assert set(numbers) == wanted if wanted else len(numbers) == 5 and not {1, 4, 7} & set(numbers)
        for capture, number in zip(captures, numbers, strict=True):
            assert np.abs(capture.camera.world_from_camera - cameras[number].world_from_camera).max() < 1e-9
    with refused(CaptureError):
        import_captures(tmp_path, path, SETTINGS, messages, Choice(("q.png",)))


def test_transforms_json_with_intrinsics_in_each_frame_and_distortion(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    frames = [{"fl_x": 50.0 + i, "k1": 0.02 * i, "p2": 0.001} for i in range(4)]
    path = _transforms(tmp_path, _poses(rng, 4), {"camera_model": "OPENCV"}, frames)
    for i, capture in enumerate(import_captures(tmp_path, path, SETTINGS).captures):
        assert capture.camera.fx == capture.camera.fy == 50.0 + i
        assert capture.lens.distortion[:4] == (0.02 * i, 0.0, 0.0, 0.001)
        assert capture.image().shape == (*capture.camera.shape, 3)


def test_transforms_json_of_blender_scenes(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    frames = [{"file_path": f"./images/p{i}"} for i in range(4)]
    path = _transforms(tmp_path, _poses(rng, 4), {"camera_angle_x": 0.9}, frames)
    camera = import_captures(tmp_path, path, SETTINGS).captures[0].camera
    assert camera.fx == pytest.approx(32 / np.tan(0.45))
    assert (camera.cx, camera.cy) == (32.0, 24.0)


def test_photographs_are_scaled_with_their_intrinsics(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph, 3, 640, 401)
    path = _transforms(tmp_path, _poses(rng, 3), {"fl_x": 500.0, "cx": 300.0, "cy": 211.0})
    camera = import_captures(tmp_path, path, CaptureSettings(max_side_px=160)).captures[0].camera
    assert (camera.width, camera.height) == (160, 100)
    assert camera.fx == 125.0 and camera.cx == 75.0
    assert camera.fy == pytest.approx(500 * 100 / 401) and camera.cy == pytest.approx(211 * 100 / 401)


def _colmap_model(folder, poses, model, params, width, height, binary):
    import pycolmap

    solved = pycolmap.Reconstruction()
    solved.add_camera_with_trivial_rig(
        pycolmap.Camera(model=model, width=width, height=height, params=params, camera_id=7)
    )
    for i, pose in enumerate(poses):
        inverse = np.linalg.inv(pose)
        solved.add_image_with_trivial_frame(
            pycolmap.Image(name=f"p{i}.png", camera_id=7, image_id=3 * i + 2),
            pycolmap.Rigid3d(pycolmap.Rotation3d(inverse[:3, :3]), inverse[:3, 3]),
        )
    folder.mkdir(parents=True)
    (solved.write_binary if binary else solved.write_text)(folder)


@pytest.mark.parametrize("binary", [True, False])
def test_colmap_models(tmp_path, rng, blank_photograph, binary):
    _photographs(tmp_path, blank_photograph)
    poses = _poses(rng, 4)
    parameters = [50.0, 56.0, 31.0, 22.0, -0.05, 0.01, 0.001, -0.002]
    _colmap_model(tmp_path / "sparse" / "0", poses, "OPENCV", parameters, 64, 48, binary)
    for garbage in ("points3D.bin", "points3D.txt"):
        (tmp_path / "sparse" / "0" / garbage).write_bytes(b"\xff" * 100)
    assert find_models(tmp_path) == [tmp_path / "sparse" / "0"]
    imported = import_captures(tmp_path / "images", tmp_path, SETTINGS)
    file = tmp_path / "sparse" / "0" / f"cameras.{'bin' if binary else 'txt'}"  # as a file browser gives it
    assert import_captures(tmp_path / "images", file, SETTINGS).source == imported.source
    assert imported.lens_file == file and imported.stated_sizes["p0.png"] == (64, 48)
    for capture, pose in zip(imported.captures, poses, strict=True):
        assert np.abs(capture.camera.world_from_camera - pose).max() < 1e-9
        assert (capture.camera.fx, capture.camera.fy) == (50.0, 56.0)
        rays = rng.uniform(-0.3, 0.3, (30, 2))
        world = np.concatenate([rays, np.ones((30, 1))], axis=1) @ pose[:3, :3].T + pose[:3, 3]
        through = capture.working_pixels(capture.lens.project(rays), (48, 64))
        assert np.abs(capture.camera.project(world)[0] - through).max() < 0.01


def test_damaged_colmap_models(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    model = tmp_path / "sparse"
    _colmap_model(model, _poses(rng, 4), "PINHOLE", [50.0, 50.0, 32.0, 24.0], 64, 48, True)
    whole = (model / "images.bin").read_bytes()
    for damaged in (b"", whole[:40], b"\xff" * 400):
        (model / "images.bin").write_bytes(damaged)
        with refused(CaptureError, model / "images.bin"):
            import_captures(tmp_path / "images", model, SETTINGS)
    (model / "images.bin").write_bytes(whole[:-30])
    with pytest.raises(CaptureError):
        import_captures(tmp_path / "images", model, SETTINGS)


def test_colmap_models_of_unsupported_lenses_and_several_models(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    _colmap_model(tmp_path / "a" / "0", _poses(rng, 4), "EQUIRECTANGULAR", [64, 48], 64, 48, False)
    with refused(CaptureError, "cameras.txt, camera 7", "EQUIRECTANGULAR"):
        import_captures(tmp_path / "images", tmp_path / "a", SETTINGS)
    _colmap_model(tmp_path / "a" / "1", _poses(rng, 4), "PINHOLE", [50, 50, 32, 24], 64, 48, False)
    with refused(CaptureError, tmp_path / "a", "2 models"):
        import_captures(tmp_path / "images", tmp_path / "a", SETTINGS)


def test_cameras_json_round_trip_and_frozen_views(tmp_path, rng, blank_photograph):
    paths = _photographs(tmp_path, blank_photograph, 5)
    cameras = [Camera(64, 48, 50.0, 55.0, 30.0, 25.0, pose) for pose in _poses(rng, 5)]
    captures = [Capture(p.name, p, c) for p, c in zip(paths, cameras, strict=True)]
    file = tmp_path / "cameras.json"
    save_cameras_json(file, captures[:3], frozen=captures[3:], about="a test")
    imported = import_captures(tmp_path, file, SETTINGS)
    assert imported.metric
    assert [c.camera.to_json() for c in imported.captures] == [c.to_json() for c in cameras[:3]]
    frozen = load_frozen_views(file)
    assert [c.camera.to_json() for c in frozen] == [c.to_json() for c in cameras[3:]]


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_cameras_json_keeps_every_lens(tmp_path, rng, blank_photograph, model):
    paths = _photographs(tmp_path, blank_photograph, 3)
    lens = Lens(64, 48, 50.0, 55.0, 30.0, 25.0, tuple(rng.uniform(0, 0.01, COEFFICIENTS[model])), model, 2.0)
    captures = [Capture(p.name, p, lens.straight(pose), lens) for p, pose in zip(paths, _poses(rng, 3), strict=True)]
    save_cameras_json(tmp_path / "cameras.json", captures)
    imported = import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)
    for found, capture in zip(imported.captures, captures, strict=True):
        assert found.lens == lens
        assert found.camera.to_json() == capture.camera.to_json()


@pytest.mark.parametrize("fisheye", [True, False])
def test_cameras_json_may_say_fisheye(tmp_path, rng, blank_photograph, fisheye):
    data = _valid(tmp_path, rng, blank_photograph) | {"distortion": [0.01, 0.002], "fisheye": fisheye}
    (tmp_path / "cameras.json").write_text(json.dumps(data))
    lens = import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS).captures[0].lens
    assert lens.model == ("opencv_fisheye" if fisheye else "opencv")


def test_importing_never_looks_at_frozen_views(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph, 3)
    listed = [{"file": f"images/p{i}.png", "world_from_camera": p.tolist()} for i, p in enumerate(_poses(rng, 3))]
    data = {"fx": 50.0, "captures": listed, "frozen": [{"file": "gone.png"}]}
    (tmp_path / "cameras.json").write_text(json.dumps(data))
    assert len(import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS).captures) == 3
    with refused(CaptureError, "cameras.json, frozen[0]", "gone.png"):
        load_frozen_views(tmp_path / "cameras.json")


def test_frozen_views_may_have_their_own_intrinsics(tmp_path, rng, blank_photograph):
    blank_photograph(tmp_path / "f.png", 32, 24)
    pose = _poses(rng, 1)[0].tolist()
    lens = {"width": 32, "height": 24, "fx": 20.0, "fy": 20.0, "cx": 16.0, "cy": 12.0}
    data = {"width": 64, "height": 48, "fx": 50.0, "frozen_intrinsics": lens}
    data["frozen"] = [{"file": "f.png", "world_from_camera": pose}]
    (tmp_path / "cameras.json").write_text(json.dumps(data))
    assert load_frozen_views(tmp_path / "cameras.json")[0].camera.fx == 20.0


@pytest.mark.parametrize("again", ["f.png", "./f.png"])
def test_a_frozen_view_that_is_listed_twice_is_refused(tmp_path, rng, blank_photograph, again):
    """It would count twice in every mean, and a second pose would be scored by the first one's pictures."""
    blank_photograph(tmp_path / "f.png", 64, 48)
    first, second = _poses(rng, 2)
    listed = [{"file": file, "world_from_camera": pose.tolist()} for file, pose in (("f.png", first), (again, second))]
    (tmp_path / "cameras.json").write_text(json.dumps({"fx": 50.0, "frozen": listed}))
    with refused(CaptureError, "cameras.json, frozen[0]", "2 times"):
        load_frozen_views(tmp_path / "cameras.json")


@pytest.mark.parametrize("orientation", [6, 8])
def test_poses_of_stored_pixels_are_turned_with_exif_orientation(tmp_path, rng, orientation):
    """COLMAP solves on the stored pixels; the photograph is used upright."""
    stored = Camera(64, 48, 50.0, 55.0, 30.0, 25.0, _poses(rng, 1)[0])
    spot = stored.unproject(np.full((48, 64), 2.0))[10, 50]
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[10, 50] = 255
    exif = Image.Exif()
    exif[274] = orientation
    listed = []
    for i in range(3):
        Image.fromarray(pixels).save(tmp_path / f"p{i}.png", exif=exif)
        listed.append({"file": f"p{i}.png"} | stored.to_json())
    (tmp_path / "cameras.json").write_text(json.dumps({"captures": listed}))
    capture = import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS).captures[0]
    assert (capture.camera.width, capture.camera.height) == (48, 64)
    place, depth = capture.camera.project(spot)
    row, column = np.argwhere(capture.image()[..., 0] > 0.5)[0]
    assert np.abs(place - [column + 0.5, row + 0.5]).max() < 1e-9
    assert depth == pytest.approx(2.0)


@pytest.mark.parametrize("solved_on", ["stored", "upright"])
@pytest.mark.parametrize("told_by", ["quarter turns", "up", "the program"])
def test_poses_of_a_photograph_that_exif_turns_by_half(tmp_path, rng, told_by, solved_on):
    """A half turn changes no shape: other photographs, or what wrote the file, tell what was solved on."""
    stored = Camera(64, 48, 50.0, 55.0, 30.0, 25.0, _poses(rng, 1)[0])
    spot = stored.unproject(np.full((48, 64), 2.0))[10, 50]
    turned = stored.world_from_camera @ np.diag([-1.0, -1.0, 1.0, 1.0])
    upright = Camera(64, 48, 50.0, 55.0, 34.0, 23.0, turned)
    given = stored if solved_on == "stored" else upright

    def photograph(name, camera, orientation):
        pixels = np.zeros((48, 64, 3), np.uint8)
        pixels[10, 50] = 255
        exif = Image.Exif()
        exif[274] = orientation
        Image.fromarray(pixels).save(tmp_path / name, exif=exif)
        lens = Lens(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
        return Photograph(name, tmp_path / name, lens, camera.world_from_camera, "test", stored_pixels=said_by_program)

    said_by_program = told_by == "the program" and solved_on == "stored"
    photographs = [photograph("half.png", given, 3)]
    if told_by == "up":
        photographs.append(photograph("plain.png", upright, 1))
    elif told_by == "quarter turns":
        size = (64, 48) if solved_on == "stored" else (48, 64)
        photographs.append(photograph("quarter.png", Camera(*size, 50.0, 50.0, 32.0, 24.0, np.eye(4)), 6))
    capture = posed_captures(photographs, 64)[0]
    row, column = np.argwhere(capture.image()[..., 0] > 0.5)[0]
    assert (row, column) == (37, 13)
    place, depth = capture.camera.project(spot)
    assert np.abs(place - [column + 0.5, row + 0.5]).max() < 1e-9
    assert depth == pytest.approx(2.0)


def _valid(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph, 4)
    listed = [{"file": f"images/p{i}.png", "world_from_camera": p.tolist()} for i, p in enumerate(_poses(rng, 4))]
    return {"width": 64, "height": 48, "fx": 50.0, "captures": listed}


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d: d["captures"].clear(), "no photograph"),
        (lambda d: d["captures"].__delitem__(slice(1, None)), "1 photograph found, at least 3"),
        (lambda d: d["captures"].__delitem__(slice(2, None)), "2 photographs found"),
        (lambda d: d["captures"].append(d["captures"][0]), r"'p0.png'|'images/p0.png' is listed 2 times"),
        (
            lambda d: d["captures"].append(d["captures"][0] | {"file": "images/../images/./p0.png"}),
            r"p0.png' is listed 2 times",
        ),
        (lambda d: d["captures"][2].update(file="images/no.png"), r"captures\[2\].*no.png.*missing"),
        (lambda d: d["captures"][2].update(file="../../../etc/passwd"), r"captures\[2\].*missing"),
        (lambda d: d["captures"][2].update(file=7), r"captures\[2\].*names no file"),
        (lambda d: d["captures"][1].pop("world_from_camera"), r"captures\[1\].*4x4"),
        (lambda d: d["captures"][1].update(world_from_camera=[[1, 2], [3]]), r"captures\[1\].*4x4"),
        (lambda d: d["captures"][1].update(world_from_camera=np.diag([2.0, 2, 2, 1]).tolist()), "rotation"),
        (lambda d: d["captures"][1].update(world_from_camera=np.diag([1.0, 1, -1, 1]).tolist()), "rotation"),
        (lambda d: d["captures"][1].update(world_from_camera=[[float("nan")] * 4] * 4), "NaN"),
        (lambda d: d.update(fx=-3), "'fx' is -3"),
        (lambda d: d.update(fx="wide"), "'fx' is 'wide'"),
        (lambda d: d.pop("fx"), "'fx' is missing"),
        (lambda d: d.update(width=48, height=64), "64x48, its camera 48x64"),
        (lambda d: d.update(distortion=[-30.0]), "cannot be undone"),
        (lambda d: d.update(distortion="k1"), "at most 8 numbers"),
        (lambda d: d.update(distortion=[0.1] * 5, fisheye=True), "at most 4 numbers"),
        (lambda d: d.update(distortion_model="glass"), "'glass', not one of opencv"),
        (lambda d: d.update(captures={}), "not a list"),
        (lambda d: d.update(metric="yes"), "neither true nor false"),
        (lambda d: d.pop("captures"), "no kind of poses"),
    ],
)
def test_what_is_wrong_with_a_cameras_json_is_said(tmp_path, rng, blank_photograph, spoil, message):
    data = _valid(tmp_path, rng, blank_photograph)
    spoil(data)
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps(data))
    with pytest.raises(CaptureError, match=message) as caught:
        import_captures(tmp_path, file, SETTINGS)
    assert str(file) in str(caught.value)
    assert caught.value.cure


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"[" * 100000])
def test_files_that_are_no_json_objects(tmp_path, content):
    (tmp_path / "cameras.json").write_bytes(content)
    with refused(CaptureError, tmp_path / "cameras.json"):
        import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)


def test_a_pose_file_that_may_not_be_read_is_not_called_damaged(tmp_path, monkeypatch):
    def denied(*_, **__):
        raise PermissionError(13, "Permission denied")

    file = tmp_path / "cameras.json"
    file.mkdir()
    with refused(CaptureError, file, cure="Check the path"):
        load_frozen_views(file)
    file.rmdir()
    file.write_text("{}")
    monkeypatch.setattr("os.open", denied)
    with refused(CaptureError, file, cure="Allow reading it"):
        load_frozen_views(file)


@pytest.mark.parametrize("content", [b"", b"not an image", b"\x89PNG\r\n\x1a\n\x00\x00"])
def test_photographs_that_cannot_be_read(tmp_path, rng, blank_photograph, content):
    data = _valid(tmp_path, rng, blank_photograph)
    (tmp_path / "images" / "p2.png").write_bytes(content)
    (tmp_path / "cameras.json").write_text(json.dumps(data))
    with refused(CaptureError, "images/p2.png"):
        import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)


@pytest.mark.parametrize("name", ["a" * 300 + ".png", "a" * 300 + "/p3.png", "a/" * 3000 + "p.png"])
def test_a_photograph_whose_name_no_file_can_have_is_missing(tmp_path, rng, blank_photograph, messages, name):
    _photographs(tmp_path, blank_photograph)
    top = {"fl_x": 50.0, "w": 64, "h": 48}
    path = _transforms(tmp_path, _poses(rng, 4), top, [{}, {}, {}, {"file_path": name}])
    assert len(import_captures(tmp_path, path, SETTINGS, messages).captures) == 3
    assert "1 of the 4 photographs" in messages.warnings[0]


def test_folders_and_pose_files_that_are_not_there(tmp_path):
    with refused(CaptureError, tmp_path / "no"):
        import_captures(tmp_path / "no", None, SETTINGS)
    with refused(CaptureError, tmp_path / "cameras.json", "missing"):
        import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)
    with refused(CaptureError, tmp_path, "COLMAP model"):
        import_captures(tmp_path, tmp_path, SETTINGS)


def test_the_room_imports_and_its_frozen_views_load(shared):
    folder = shared("scenes/room_a")
    imported = import_captures(folder, folder / "cameras.json", SETTINGS)
    assert len(imported.captures) == 6 and imported.metric
    assert len(load_frozen_views(folder / "cameras.json")) == 16


@pytest.mark.parametrize("name", ["images/p\x1b[2J.png", "images/p\n.png", "images/p\u202e.png"])
def test_a_name_that_controls_a_terminal_is_refused_in_words_that_do_not(tmp_path, rng, blank_photograph, name):
    data = _valid(tmp_path, rng, blank_photograph)
    (tmp_path / "images" / "p2.png").rename(tmp_path / name)
    data["captures"][2]["file"] = name
    (tmp_path / "cameras.json").write_text(json.dumps(data))
    with pytest.raises(CaptureError, match=r"cameras\.json, captures\[2\]") as caught:
        import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "changes",
    [
        {"width": 0.5},
        {"width": 10**300},
        {"height": 70_000},
        {"fx": 1e300},
        {"cx": -1e300},
        {"border_px": -1},
        {"border_px": 40},
        {"distortion": [1e300]},
        {"distortion_model": ["fov"]},
        {"distortion_model": {}},
    ],
)
def test_a_lens_through_which_nothing_is_seen_is_refused(tmp_path, rng, blank_photograph, changes):
    data = _valid(tmp_path, rng, blank_photograph)
    (tmp_path / "cameras.json").write_text(json.dumps(data | changes))
    with np.errstate(all="raise"), pytest.raises(CaptureError, match=r"cameras\.json"):
        import_captures(tmp_path, tmp_path / "cameras.json", SETTINGS)
