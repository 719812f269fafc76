"""transforms.json as instant-ngp, nerfstudio and their exporters write it."""

from __future__ import annotations

import json
import unicodedata
from pathlib import Path

import numpy as np
import pytest
from dataset_folders import pose as pose_of
from dataset_folders import scannetpp
from expected_errors import refused
from PIL import Image
from splat_photographs import write_points

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.formats.transforms_json import points
from r2sego_blender.captures.poses.transforms_json import read_transforms_json
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import CaptureError

SETTINGS = CaptureSettings()
GL = np.diag([1.0, -1.0, -1.0, 1.0])


def _poses(rng, count=4):
    return [look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3)) for _ in range(count)]


def _written(folder, poses, top, frames=None, names="images/{}.jpg"):
    listed = [
        {"file_path": names.format(f"{i:04d}"), "transform_matrix": (pose @ GL).tolist()}
        | (frames[i] if frames else {})
        for i, pose in enumerate(poses)
    ]
    (folder / "transforms.json").write_text(json.dumps(top | {"frames": listed}))
    return folder / "transforms.json"


def _photographs(folder, blank_photograph, suffix="jpg", count=4, width=64, height=48):
    for i in range(count):
        blank_photograph(folder / "images" / f"{i:04d}.{suffix}", width, height)


def test_what_instant_ngps_script_writes(tmp_path, rng, blank_photograph):
    """colmap2nerf.py: angles, focal lengths, distortion, aabb_scale and sharpness together."""
    _photographs(tmp_path, blank_photograph)
    fl_x, fl_y = 51.0, 52.5
    top = {
        "camera_angle_x": 2 * np.arctan(32 / fl_x),
        "camera_angle_y": 2 * np.arctan(24 / fl_y),
        "fl_x": fl_x,
        "fl_y": fl_y,
        "k1": 0.01,
        "k2": -0.002,
        "k3": 0,
        "k4": 0,
        "p1": 0.0003,
        "p2": -0.0002,
        "is_fisheye": False,
        "cx": 31.2,
        "cy": 25.1,
        "w": 64.0,
        "h": 48.0,
        "aabb_scale": 32,
    }
    poses = _poses(rng)
    frames = [{"sharpness": 30.2 + i} for i in range(4)]
    path = _written(tmp_path, poses, top, frames, "./images/{}.jpg")
    for given in (path, tmp_path):
        for capture, pose in zip(import_captures(tmp_path, given, SETTINGS).captures, poses, strict=True):
            assert (capture.lens.fx, capture.lens.fy, capture.lens.cx, capture.lens.cy) == (51, 52.5, 31.2, 25.1)
            assert capture.lens.distortion[:4] == (0.01, -0.002, 0.0003, -0.0002)
            assert np.abs(capture.camera.world_from_camera - pose).max() < 1e-9


def test_a_file_that_begins_with_a_byte_order_mark(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0})
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(import_captures(tmp_path, path, SETTINGS).captures) == 4


@pytest.mark.parametrize("suffix", ["png", "jpg", "jpeg", "webp"])
def test_names_without_a_suffix(tmp_path, rng, blank_photograph, suffix):
    _photographs(tmp_path, blank_photograph, suffix)
    path = _written(tmp_path, _poses(rng), {"camera_angle_x": 0.8}, names="./images/{}")
    captures = import_captures(tmp_path, path, SETTINGS).captures
    assert [capture.image_path.suffix for capture in captures] == [f".{suffix}"] * 4


@pytest.mark.parametrize(
    ("top", "focal"),
    [
        ({"camera_angle_x": 0.9}, (32 / np.tan(0.45),) * 2),
        ({"camera_angle_x": 0.9, "camera_angle_y": 0.7}, (32 / np.tan(0.45), 24 / np.tan(0.35))),
        ({"camera_angle_y": 0.7}, (24 / np.tan(0.35),) * 2),
        ({"x_fov": 60.0}, (32 / np.tan(np.pi / 6),) * 2),
        ({"x_fov": 60.0, "y_fov": 50.0}, (32 / np.tan(np.pi / 6), 24 / np.tan(np.radians(25)))),
        ({"fl_x": 50.0, "camera_angle_x": 0.1}, (50.0, 50.0)),
        ({"fl_y": 44.0}, (44.0, 44.0)),
    ],
)
def test_every_way_to_say_the_focal_length(tmp_path, rng, blank_photograph, top, focal):
    _photographs(tmp_path, blank_photograph)
    camera = import_captures(tmp_path, _written(tmp_path, _poses(rng), top), SETTINGS).captures[0].camera
    assert (camera.fx, camera.fy) == pytest.approx(focal, rel=1e-12)


def test_what_nerfstudio_writes(tmp_path, rng, blank_photograph):
    """Intrinsics a frame, an applied transform, depth, masks and a point cloud beside them."""
    _photographs(tmp_path, blank_photograph)
    top = {
        "camera_model": "OPENCV",
        "orientation_override": "none",
        "ply_file_path": "sparse_pc.ply",
        "applied_transform": [[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0]],
        "applied_scale": 0.5,
        "train_filenames": ["images/0000.jpg"],
    }
    frames = [
        {
            "fl_x": 50.0 + i,
            "fl_y": 51.0,
            "cx": 30.0,
            "cy": 25.0,
            "w": 64,
            "h": 48,
            "k1": 0.01 * i,
            "depth_file_path": f"depth/{i:04d}.png",
            "mask_path": "no/such/mask.png",
            "colmap_im_id": i,
        }
        for i in range(4)
    ]
    poses = _poses(rng)
    captures = import_captures(tmp_path, _written(tmp_path, poses, top, frames), SETTINGS).captures
    for i, (capture, pose) in enumerate(zip(captures, poses, strict=True)):
        assert capture.camera.fx == 50.0 + i and capture.camera.fy == 51.0
        assert np.abs(capture.camera.world_from_camera - pose).max() < 1e-9


def _names_of(folder, path, messages, held_out=False):
    return [photograph.name for photograph in read_transforms_json(path, folder, messages, held_out)[0]]


@pytest.mark.parametrize("spelt", ["images/{}.jpg", "./images/{}.JPG"])
def test_frames_that_are_held_out_are_not_imported(tmp_path, rng, blank_photograph, messages, spelt):
    """Of nerfstudio's three lists; whoever is trained on is not held out, and in none neither."""
    _photographs(tmp_path, blank_photograph, count=6)
    split = {
        "train_filenames": [spelt.format("0000"), spelt.format("0001")],
        "val_filenames": [spelt.format("0001"), spelt.format("0002")],
        "test_filenames": [spelt.format("0003")],
    }
    frames = [{"mask_path": "no.png"}] * 6
    path = _written(tmp_path, _poses(rng, 6), {"fl_x": 50.0, **split}, frames)
    kept = [f"{i:04d}.jpg" for i in (0, 1, 4, 5)]
    assert [capture.name for capture in import_captures(tmp_path, path, SETTINGS, messages).captures] == kept
    assert messages.warnings == [] and any(
        "0002.jpg" in text and "0003.jpg" in text and "held out" in text for _, text in messages.messages
    )
    assert import_captures(tmp_path, path, SETTINGS).masks == len(kept)
    assert _names_of(tmp_path, path, messages, held_out=True) == ["0002.jpg", "0003.jpg"]


def test_without_a_split_all_frames_are_imported_or_scored(tmp_path, rng, blank_photograph, messages):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0, "test_filenames": [], "train_filenames": None})
    assert len(_names_of(tmp_path, path, messages)) == len(_names_of(tmp_path, path, messages, held_out=True)) == 4
    assert messages.messages == []


def test_frames_that_are_marked_bad_are_left_out_and_named(tmp_path, rng, blank_photograph, messages):
    _photographs(tmp_path, blank_photograph, count=5)
    frames = [{"is_bad": bad} for bad in (False, True, False, True, "no")]
    told = {"fl_x": 50.0, "test_filenames": ["images/0003.jpg"]}
    path = _written(tmp_path, _poses(rng, 5), told, frames)
    assert _names_of(tmp_path, path, messages) == ["0000.jpg", "0002.jpg", "0004.jpg"]
    [(_, text)] = messages.messages
    assert "0001.jpg" in text and "0003.jpg" in text and "is_bad" in text


@pytest.mark.parametrize("names", ["images/0001.jpg", [1], {"images/0001.jpg": True}])
def test_a_split_that_is_no_list_of_names_is_refused(tmp_path, rng, blank_photograph, names):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0, "test_filenames": names})
    with refused(CaptureError, path, "'test_filenames'"):
        import_captures(tmp_path, path, SETTINGS)


def test_held_out_names_of_no_frame_are_told(tmp_path, rng, blank_photograph, messages):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0, "test_filenames": ["images/0009.jpg"]})
    assert len(_names_of(tmp_path, path, messages)) == 4
    assert any("'test_filenames'" in text for text in messages.warnings)


def _nerfstudio_radial(rays, k1, k2, k3, k4, p1, p2):
    """nerfstudio's camera_utils: four radial terms, then the tangential ones."""
    x, y = rays.T
    r = x * x + y * y
    d = 1 + r * (k1 + r * (k2 + r * (k3 + r * k4)))
    return np.stack(
        [x * d + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * d + 2 * p2 * x * y + p1 * (r + 2 * y * y)], axis=1
    )


def test_k4_is_a_radial_term_to_nerfstudio(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    k = {"k1": -0.1, "k2": 0.03, "k3": -0.01, "k4": 0.02, "p1": 0.001, "p2": -0.002}
    top = {"camera_model": "OPENCV", "fl_x": 50.0, "fl_y": 52.0, "cx": 31.0, "cy": 25.0, "w": 64, "h": 48} | k
    capture = import_captures(tmp_path, _written(tmp_path, _poses(rng), top), SETTINGS).captures[0]
    rays = rng.uniform([-0.5, -0.4], [0.5, 0.4], (60, 2))
    pixels = _nerfstudio_radial(rays, **k) * [50.0, 52.0] + [31.0, 25.0]
    assert np.abs(capture.lens.project(rays) - pixels).max() < 1e-9
    assert np.abs(capture.lens.rays(pixels) - rays).max() < 1e-9
    straight = rays * [capture.camera.fx, capture.camera.fy] + [capture.camera.cx, capture.camera.cy]
    assert np.abs(capture.working_pixels(pixels, (48, 64)) - straight).max() < 0.01


@pytest.mark.parametrize(
    ("top", "model", "distortion"),
    [
        ({"camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k4": 0.01}, "opencv_fisheye", (0.1, 0, 0, 0.01)),
        ({"is_fisheye": True, "k1": 0.1}, "opencv_fisheye", (0.1, 0, 0, 0)),
        ({"camera_model": "FULL_OPENCV", "k4": 0.02, "k6": 0.01}, "opencv", (0, 0, 0, 0, 0, 0.02, 0, 0.01)),
        ({"camera_model": "FISHEYE624", "distortion_params": [0.01] * 12}, "rad_tan_thin_prism_fisheye", (0.01,) * 12),
    ],
)
def test_lens_models(tmp_path, rng, blank_photograph, top, model, distortion):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0} | top)
    lens = import_captures(tmp_path, path, SETTINGS).captures[0].lens
    assert (lens.model, lens.distortion) == (model, distortion)


@pytest.mark.parametrize("said", ["stored", "upright", "nothing but the principal point", "nothing"])
@pytest.mark.parametrize("orientation", [6, 8])
def test_portrait_photographs_with_exif_orientation(tmp_path, rng, orientation, said):
    """The file says the lens of the stored pixels or of the upright ones; the dot is found in both."""
    stored = Camera(64, 48, 50.0, 50.0, *((32.0, 24.0) if said == "nothing" else (34.0, 23.0)), _poses(rng, 1)[0])
    upright, height = orientation == 6, 2.0
    spot = stored.unproject(np.full((48, 64), height))[10, 50]
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[10, 50] = 255
    exif = Image.Exif()
    exif[274] = orientation
    (tmp_path / "images").mkdir()
    for i in range(3):
        Image.fromarray(pixels).save(tmp_path / "images" / f"{i:04d}.png", exif=exif)
    pose, top = stored.world_from_camera, {"fl_x": 50.0, "cx": stored.cx, "cy": stored.cy}
    if said in ("upright", "nothing"):
        turn = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        pose = pose @ (turn.T if upright else turn)
        clockwise = (48 - stored.cy, stored.cx)
        top["cx"], top["cy"] = clockwise if upright else (stored.cy, 64 - stored.cx)
    if said == "nothing":
        top = {"fl_x": 50.0}
    elif said != "nothing but the principal point":
        top |= {"w": 64, "h": 48} if said == "stored" else {"w": 48, "h": 64}
    path = _written(tmp_path, [pose] * 3, top, names="images/{}.png")
    capture = import_captures(tmp_path, path, SETTINGS).captures[0]
    assert (capture.camera.width, capture.camera.height) == (48, 64)
    row, column = np.argwhere(capture.image()[..., 0] > 0.5)[0]
    place, depth = capture.camera.project(spot)
    assert np.abs(place - [column + 0.5, row + 0.5]).max() < 1e-9
    assert depth == pytest.approx(height)


def test_a_folder_is_looked_through_once_for_all_missing(tmp_path, rng, blank_photograph, monkeypatch):
    """A file of thousands of poses may lie beside some hundred photographs."""
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng, 200), {"fl_x": 50.0})
    read, iterdir = [], Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda folder: read.append(folder) or iterdir(folder))
    assert len(import_captures(tmp_path, path, SETTINGS).captures) == 4
    assert len(read) == len(set(read)) > 0


def test_photographs_that_are_missing_are_left_out(tmp_path, rng, blank_photograph, messages):
    _photographs(tmp_path, blank_photograph)
    (tmp_path / "images" / "0002.jpg").unlink()
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0})
    captures = import_captures(tmp_path, path, SETTINGS, messages).captures
    assert [capture.name for capture in captures] == ["0000.jpg", "0001.jpg", "0003.jpg"]
    assert any("0002.jpg" in text for text in messages.warnings)


@pytest.mark.parametrize("name", ["images/a\0b.jpg", f"images/{'a' * 300}.jpg", "images/loop.jpg"])
def test_names_that_can_be_no_photographs_are_missing_ones(tmp_path, rng, blank_photograph, messages, name):
    """What cannot be a file's name, and a link to itself."""
    _photographs(tmp_path, blank_photograph)
    (tmp_path / "images" / "loop.jpg").symlink_to("loop.jpg")
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0})
    told = json.loads(path.read_text())
    told["frames"][2]["file_path"] = name
    path.write_text(json.dumps(told))
    captures = import_captures(tmp_path, path, SETTINGS, messages).captures
    assert [capture.name for capture in captures] == ["0000.jpg", "0001.jpg", "0003.jpg"]
    assert any("left out" in text for text in messages.warnings)


@pytest.mark.parametrize(
    ("listed", "kind"),
    [
        ("images/{}.jpg", "JPG"),
        ("images/{}", "JPG"),
        ("images/{}.HEIC", "jpg"),
        ("images/{}.jpg", "HEIC"),
        ("C:\\room\\images\\{}.JPG", "jpg"),
        ("/home/somebody/room/images/{}.heic", "jpeg"),
    ],
)
def test_photographs_of_another_case_or_kind_are_found(tmp_path, rng, blank_photograph, listed, kind):
    _photographs(tmp_path, blank_photograph, kind)
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0}, names=listed)
    captures = import_captures(tmp_path / "images", path, SETTINGS).captures
    found = [capture.image_path.name.lower() for capture in captures]  # some systems find either case
    assert found == [f"{i:04d}.{kind}".lower() for i in range(4)]
    assert captures[0].name == f"0000{listed.partition('{}')[2]}"


@pytest.mark.parametrize(("listed", "stored"), [("NFC", "NFD"), ("NFD", "NFC")])
@pytest.mark.parametrize("folder", ["images", "Küche"])
def test_names_that_look_the_same_are_found(tmp_path, rng, blank_photograph, messages, listed, stored, folder):
    """Composed in the file and decomposed on the disk, as zips from a Mac are; folders, too."""
    for i in range(4):
        name = unicodedata.normalize(stored, f"{folder}/Büro {i}.jpg")
        blank_photograph(tmp_path / name, 64, 48)
    write_points(tmp_path / unicodedata.normalize(stored, "Büro.ply"))
    names = [unicodedata.normalize(listed, f"{folder}/Büro {i}.{'JPG' if i else 'jpg'}") for i in range(4)]
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0, "ply_file_path": unicodedata.normalize(listed, "Büro.ply")})
    data = json.loads(path.read_text())
    for frame, name in zip(data["frames"], names, strict=True):
        frame["file_path"] = name
    path.write_text(json.dumps(data, ensure_ascii=False), encoding="utf-8")
    captures = import_captures(tmp_path, path, SETTINGS, messages).captures
    assert [capture.name for capture in captures] == [name.rpartition("/")[2] for name in names]
    assert all(capture.image_path.is_file() for capture in captures) and messages.warnings == []
    assert points(path, messages) is not None


def test_of_two_kinds_the_named_one_is_taken_or_none(tmp_path, rng, blank_photograph):
    """A depth map beside its photograph is no photograph of another kind."""
    _photographs(tmp_path, blank_photograph, "JPG")
    _photographs(tmp_path, blank_photograph, "png")
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0}, names="images/{}.jpg")
    captures = import_captures(tmp_path, path, SETTINGS).captures
    assert [capture.image_path.suffix.lower() for capture in captures] == [".jpg"] * 4
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0}, names="images/{}.webp")
    with refused(CaptureError, path, "4 of the 4"):
        import_captures(tmp_path, path, SETTINGS)


def test_a_name_without_a_suffix_is_of_no_depth_map(tmp_path, rng, blank_photograph):
    _photographs(tmp_path, blank_photograph)
    for i in range(4):
        Image.fromarray(np.full((48, 64), 2000, np.uint16)).save(tmp_path / "images" / f"{i:04d}.png")
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0}, names="images/{}")
    captures = import_captures(tmp_path, path, SETTINGS).captures
    assert [capture.image_path.suffix for capture in captures] == [".jpg"] * 4


@pytest.mark.parametrize(
    ("listed", "taken"), [("{}.HEIC", "HEIC"), ("{}", "jpg"), ("{}.JPG", "jpg"), ("{}.png", "jpg")]
)
def test_a_heic_is_taken_beside_its_jpeg_only_where_it_is_named(tmp_path, rng, blank_photograph, listed, taken):
    _photographs(tmp_path, blank_photograph, "HEIC")
    _photographs(tmp_path, blank_photograph, "jpg")
    path = _written(tmp_path, _poses(rng), {"fl_x": 50.0}, names=f"images/{listed}")
    captures = import_captures(tmp_path, path, SETTINGS).captures
    found = [capture.image_path.name.lower() for capture in captures]  # some systems find either case
    assert found == [f"{i:04d}.{taken}".lower() for i in range(4)]


@pytest.mark.parametrize(
    ("top", "message"),
    [
        ({}, "neither 'fl_x' nor"),
        ({"x_fov": 200.0}, "'x_fov' is 200, not an angle"),
        ({"camera_angle_x": 60.0}, "'camera_angle_x' is 60, not an angle"),
        ({"fl_x": 50.0, "w": 64}, "'h' is missing"),
        ({"fl_x": 50.0, "camera_model": "OMNIDIRECTIONALSTEREO_L"}, "not supported"),
        ({"fl_x": 50.0, "camera_model": "FISHEYE624"}, "'distortion_params' has 0 numbers"),
        ({"fl_x": 50.0, "camera_model": "FISHEYE624", "distortion_params": ["a"] * 12}, "is 'a'"),
        ({"fl_x": 50.0, "k1": "much"}, "'k1' is 'much'"),
        ({"fl_x": 100.0, "cx": 64.0, "cy": 48.0}, "'cx', 'cy' are 64, 48, outside a photograph of 64x48"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, rng, blank_photograph, top, message):
    _photographs(tmp_path, blank_photograph)
    path = _written(tmp_path, _poses(rng), top)
    with pytest.raises(CaptureError, match=message) as caught:
        import_captures(tmp_path, path, SETTINGS)
    assert str(path) in str(caught.value)


def test_points_lie_beside_the_file_that_names_them(tmp_path, rng, messages):
    (tmp_path / "room").mkdir()
    file = _written(tmp_path / "room", _poses(rng), {"fl_x": 50.0, "ply_file_path": "../outside.ply"})
    write_points(tmp_path / "outside.ply")
    assert points(file, messages) is None
    assert any("outside.ply" in text for text in messages.warnings)
    write_points(file.parent / "sparse.ply")
    file.write_text(file.read_text().replace("../outside.ply", "sparse.ply"))
    assert len(points(file, messages)[0])


def test_test_frames_of_scannetpp_are_held_out_and_its_fisheye_is_known(tmp_path, messages):
    file = scannetpp(tmp_path / "room", train=5, test=2)
    images = tmp_path / "room/dslr/resized_images"
    data = json.loads(file.read_text())
    data["test_frames"].append({**data["test_frames"][0], "is_bad": True})
    file.write_text(json.dumps(data))
    learnt, _ = read_transforms_json(file, images, messages)
    held_out, _ = read_transforms_json(file, images, held_out=True)
    assert [one.name for one in learnt] == [f"DSC{number:05d}.JPG" for number in (4, 3, 2, 1, 0)]
    assert [one.name for one in held_out] == ["DSC00005.JPG", "DSC00006.JPG"]
    assert all("test_frames" in text and "2 of the 7" in text for _, text in messages.messages)
    for one in (*learnt, *held_out):
        assert np.abs(one.world_from_camera - pose_of(int(one.name[3:8]))).max() < 1e-12
        assert one.lens.model == "opencv_fisheye" and one.lens.distortion == (-0.03, 0.004, 0.001, 0.0)
    file.write_text(json.dumps({**data, "test_frames": {"file_path": "a.png"}}))
    with refused(CaptureError, file, "test_frames"):
        read_transforms_json(file, images)
