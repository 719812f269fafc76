"""Poses of plain photographs, and what is said when they cannot be found."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from expected_errors import refused
from PIL import Image

from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.matching.overlap import match_all
from r2sego_blender.captures.solving import solving
from r2sego_blender.captures.solving.solving import solve_poses
from r2sego_blender.captures.sparse import triangulate
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at, rotation_angle_rad
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import resize, save_image, to_uint8

SETTINGS = CaptureSettings(max_features=2500)


def _relative_errors_deg(captures, truth):
    errors = []
    for i in range(len(captures)):
        for j in range(i):
            turn = captures[i].camera.camera_from_world @ captures[j].camera.world_from_camera
            true = truth[i].camera_from_world @ truth[j].world_from_camera
            errors.append(np.degrees(rotation_angle_rad(turn, true)))
    return np.array(errors)


def test_photographs_without_poses_are_solved_the_same_way_each_time_and_in_any_folder(
    room_captures, room_cameras, tmp_path, messages, elsewhere
):
    for capture in room_captures:
        save_image(tmp_path / capture.name, capture.image())
    save_image(tmp_path / "stranger.png", np.full((300, 400, 3), 0.5, np.float32))
    first = import_captures(tmp_path, None, SETTINGS, messages)
    assert not first.metric and "5 of 6" in first.source
    assert len(messages.warnings) == 1 and "stranger.png" in messages.warnings[0]
    assert _relative_errors_deg(first.captures, room_cameras).max() < 0.5
    assert first.captures[0].camera.fx == pytest.approx(300.0, rel=0.03)
    elsewhere()
    second = import_captures(tmp_path, None, SETTINGS)
    for a, b in zip(first.captures, second.captures, strict=True):
        assert a.camera.to_json() == b.camera.to_json()


@pytest.mark.parametrize("side_px", [280, 1600])
def test_poses_are_solved_at_the_size_that_is_set(room_captures, tmp_path, messages, side_px):
    for capture in room_captures:
        save_image(tmp_path / capture.name, capture.image())
    settings = CaptureSettings(max_features=2500, solve_max_side_px=side_px)
    photographs, _ = solve_poses(tmp_path, settings, messages)
    assert {one.lens.width for one in photographs} == {min(side_px, 400)}


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_photographs(tmp_path, blank_photograph, count):
    for index in range(count):
        blank_photograph(tmp_path / f"{index}.png")
    with pytest.raises(CaptureError, match=f"{count} photographs? found, at least 3"):
        import_captures(tmp_path, None, SETTINGS)


def test_of_more_photographs_as_many_are_solved_as_are_asked_for(room_captures, tmp_path, messages):
    for index in range(12):
        save_image(tmp_path / f"{index:02d}.png", room_captures[index // 3].image() * (1.0 - 0.01 * index))
    photographs, source = solve_poses(tmp_path, CaptureSettings(max_features=2500, max_keyframes=4), messages)
    assert source.endswith("4 of 4 photographs")
    assert [int(one.name[:2]) // 3 for one in photographs] == [0, 1, 2, 3]
    given, _ = solve_poses(tmp_path, SETTINGS, messages, ["01.png", "04.png", "09.png"])
    assert [one.name for one in given] == ["01.png", "04.png", "09.png"]


def test_photographs_that_share_nothing(tmp_path, blank_photograph):
    for index in range(3):
        blank_photograph(tmp_path / f"{index}.png", 200, 150)
    with refused(CaptureError, tmp_path, "3 photographs", cure="walk sideways"):
        import_captures(tmp_path, None, SETTINGS)


def test_too_few_of_them_register(tmp_path, room_captures, blank_photograph):
    for capture in room_captures[:3]:
        save_image(tmp_path / capture.name, capture.image())
    for index in range(4):
        blank_photograph(tmp_path / f"stranger{index}.png", 200, 150)
    with pytest.raises(CaptureError, match=r"only \d of 7 photographs.*left out: .*stranger0\.png"):
        import_captures(tmp_path, None, SETTINGS)


def test_photographs_from_one_spot(room, room_cameras, tmp_path):
    """Some focal length makes places of turns, so that all would register, in a room of no truth."""
    for index, angle in enumerate((-0.2, -0.1, 0.0, 0.1)):
        turn = np.eye(4)
        turn[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        camera = room_cameras[2].at(room_cameras[2].world_from_camera @ turn)
        save_image(tmp_path / f"{index}.png", room.image(camera))
    with refused(CaptureError, "camera poses", "no depth", cure="walk sideways"):
        import_captures(tmp_path, None, SETTINGS)
    for index in range(3):  # with as many that share nothing, the overlap is what lacks
        save_image(tmp_path / f"stranger{index}.png", np.random.default_rng(index).random((150, 200, 3)))
    for index in (1, 3):
        (tmp_path / f"{index}.png").unlink()
    with refused(CaptureError, tmp_path, "only 0 of 5"):
        import_captures(tmp_path, None, SETTINGS)


def test_zoomed_photographs_without_exif_have_a_lens_of_their_own(room_captures, room_cameras, tmp_path, messages):
    """Under one lens for all, most of them fall and the focal length is that of none."""
    for index, capture in enumerate(room_captures):
        image = capture.image()
        if index in (1, 3):
            image = resize(image[45:255, 60:340], 400, 300)
        save_image(tmp_path / capture.name, image)
    captures = import_captures(tmp_path, None, SETTINGS, messages).captures
    assert not messages.warnings
    assert _relative_errors_deg(captures, room_cameras).max() < 0.5
    focal = [300.0 / 0.7 if index in (1, 3) else 300.0 for index in range(5)]
    assert [capture.camera.fx for capture in captures] == pytest.approx(focal, rel=0.05)


def test_photographs_of_formats_that_colmap_does_not_read(room_captures, room_cameras, tmp_path):
    """Their EXIF counts too: 28 mm of a film's 43.27 mm diagonal are 323.6 of 500 pixels."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    for capture, suffix in zip(room_captures, ("webp", "avif", "heic", "heic", "webp"), strict=True):
        path = (tmp_path / capture.name).with_suffix(f".{suffix}")
        Image.fromarray(to_uint8(capture.image())).save(path, quality=95, exif=exif.tobytes())
    captures = import_captures(tmp_path, None, SETTINGS).captures
    assert _relative_errors_deg(captures, room_cameras).max() < 0.5


def test_an_unreadable_photograph_is_named(tmp_path, room_captures):
    for capture in room_captures[:3]:
        save_image(tmp_path / capture.name, capture.image())
    (tmp_path / "zzz.jpg").write_bytes(b"\xff\xd8\xff")
    with refused(CaptureError, tmp_path / "zzz.jpg"):
        import_captures(tmp_path, None, SETTINGS)


@pytest.mark.slow
def test_the_desk_registers_completely(shared, messages):
    folder = shared("captures/tum_desk")
    settings = CaptureSettings(max_features=3000)
    imported = import_captures(folder, None, settings, messages)
    assert len(imported.captures) == 17
    assert imported.captures[0].camera.fx == pytest.approx(531, rel=0.03)
    sparse = triangulate(imported.captures, settings)
    assert len(sparse.points) > 2000
    registration = register(imported, sparse, Scale(), settings, messages)
    world = registration.captures(imported.captures)
    up = -np.mean([capture.camera.world_from_camera[:3, 1] for capture in world], axis=0)
    assert up[2] > 0.7
    assert registration.scale_source.startswith("assumed")


@pytest.mark.parametrize("matcher", ["sift", "xfeat"])
def test_a_photograph_that_shares_almost_all_with_one_other_is_placed(room, room_cameras, tmp_path, messages, matcher):
    """Too few of its points are seen by a third for COLMAP alone."""
    turned = room_cameras[0].at(look_at((-1.3, -2.1, 1.5), (-2.4, -1.12, 0.6)))
    for index, camera in enumerate([*room_cameras, turned]):
        save_image(tmp_path / f"{index}.png", room.image(camera))
    settings = CaptureSettings(max_features=2500, matcher=matcher)
    captures = import_captures(tmp_path, None, settings, messages).captures
    assert [capture.name for capture in captures] == [f"{index}.png" for index in range(6)]
    assert _relative_errors_deg(captures, [*room_cameras, turned]).max() < 0.7


def test_groups_that_share_a_photograph_and_no_point_of_three_are_joined(
    room_captures, room_cameras, tmp_path, messages, monkeypatch
):
    """What each measured of that photograph lies side by side there, so both get one scale."""
    for capture in room_captures:
        save_image(tmp_path / capture.name, capture.image())

    def in_two_groups(*arguments):
        pairs = match_all(*arguments)
        of_first = np.unique(np.concatenate([pairs[i, 2][:, 1] for i in (0, 1)]))
        of_second = np.unique(np.concatenate([pairs[2, i][:, 0] for i in (3, 4)]))
        both = np.intersect1d(of_first, of_second)
        cut = {pair: rows for pair, rows in pairs.items() if pair[1] <= 2 or pair[0] >= 2}
        of_one = [np.setdiff1d(of_first, both[::2]), np.setdiff1d(of_second, both[1::2])]
        for pair, own, kept in (((0, 2), 1, 0), ((1, 2), 1, 0), ((2, 3), 0, 1), ((2, 4), 0, 1)):
            cut[pair] = cut[pair][np.isin(cut[pair][:, own], of_one[kept])]
        return cut

    monkeypatch.setattr(solving, "match_all", in_two_groups)
    settings = CaptureSettings(max_features=5000, matcher="sift")
    captures = import_captures(tmp_path, None, settings, messages).captures
    assert [capture.name for capture in captures] == [capture.name for capture in room_captures]
    assert any("photo3.png, photo4.png" in told for told in messages.warnings)
    assert _relative_errors_deg(captures, room_cameras).max() < 0.7
    away = [
        np.linalg.norm(cameras[i].centre - cameras[j].centre)
        for cameras in ([capture.camera for capture in captures], room_cameras)
        for i, j in ((0, 2), (2, 4))
    ]
    assert away[1] / away[0] == pytest.approx(away[3] / away[2], rel=0.05)


@pytest.mark.slow
def test_an_office_of_which_sift_places_two_thirds_registers_completely(shared, tmp_path, messages):
    """Twelve frames of a walk, each turned by 29 degrees in the mean; the recorded poses are off by centimetres too."""
    folder = shared("captures/holo_office")
    poses = np.loadtxt(folder / "poses_c2w.txt").reshape(-1, 4, 4)[36:48]
    names = sorted(path.name for path in (folder / "images").iterdir())[36:48]
    for name in names:
        shutil.copy(folder / "images" / name, tmp_path / name)
    photographs, _ = solve_poses(tmp_path, CaptureSettings(), messages)
    assert [one.name for one in photographs] == names
    assert photographs[0].lens.fx == pytest.approx(495.6, rel=0.04)
    found = np.array([one.world_from_camera for one in photographs])
    relative, true = np.linalg.inv(found[0]) @ found, np.linalg.inv(poses[0]) @ poses
    errors = [np.degrees(rotation_angle_rad(a, b)) for a, b in zip(relative, true, strict=True)]
    assert np.median(errors) < 3.0 and max(errors) < 8.0


@pytest.mark.slow
def test_a_photograph_at_a_wrong_place_is_left_out(shared, messages):
    """The sixth capture shares too little with the others to be placed by SIFT, and by XFeat only just."""
    import json

    folder = shared("scenes/room_a")
    truth = {
        entry["file"].rpartition("/")[2]: np.array(entry["world_from_camera"])
        for entry in json.loads((folder / "cameras.json").read_text())["captures"]
    }
    imported = import_captures(folder / "captures", None, CaptureSettings(), messages)
    assert len(imported.captures) >= 5
    first = imported.captures[0]
    for capture in imported.captures:
        turn = first.camera.camera_from_world @ capture.camera.world_from_camera
        true = np.linalg.inv(truth[first.name]) @ truth[capture.name]
        assert np.degrees(rotation_angle_rad(turn, true)) < 1.0


@pytest.mark.parametrize("exif_mm", [18, 27])
def test_a_cropped_picture_has_the_focal_length_that_the_photographs_say(room_captures, tmp_path, messages, exif_mm):
    """27 mm are right; 18 are those of a picture of which two thirds are left."""
    for capture in room_captures:
        picture = Image.fromarray(to_uint8(capture.image()))
        exif = picture.getexif()
        exif.get_ifd(0x8769)[0xA405] = exif_mm
        picture.save(tmp_path / capture.name.replace("png", "jpg"), quality=95, exif=exif)
    photographs, _ = solve_poses(tmp_path, SETTINGS, messages)
    assert [one.lens.fx for one in photographs] == pytest.approx([300.0] * 5, rel=0.02)
    assert any("EXIF" in text for _, text in messages.messages) == (exif_mm != 27)
