"""Poses of plain photographs, and what is said when they cannot be found."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.cameras import rotation_angle_rad
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.registration import register
from r2sego_blender.captures.scale import Scale
from r2sego_blender.captures.sparse import triangulate
from r2sego_blender.errors import CaptureError
from r2sego_blender.images import save_image
from r2sego_blender.settings import CaptureSettings

SETTINGS = CaptureSettings(max_features=2500)


def _relative_errors_deg(captures, truth):
    errors = []
    for i in range(len(captures)):
        for j in range(i):
            turn = captures[i].camera.camera_from_world @ captures[j].camera.world_from_camera
            true = truth[i].camera_from_world @ truth[j].world_from_camera
            errors.append(np.degrees(rotation_angle_rad(turn, true)))
    return np.array(errors)


def test_photographs_without_poses_are_solved_the_same_way_each_time(
    room_captures, room_cameras, tmp_path, messages
):  # fmt: skip
    for capture in room_captures:
        save_image(tmp_path / capture.name, capture.image())
    save_image(tmp_path / "stranger.png", np.full((300, 400, 3), 0.5, np.float32))
    first = import_captures(tmp_path, None, SETTINGS, messages)
    assert not first.metric and "5 of 6" in first.source
    assert len(messages.warnings) == 1 and "stranger.png" in messages.warnings[0]
    assert _relative_errors_deg(first.captures, room_cameras).max() < 0.5
    assert first.captures[0].camera.fx == pytest.approx(300.0, rel=0.03)
    second = import_captures(tmp_path, None, SETTINGS)
    for a, b in zip(first.captures, second.captures, strict=True):
        assert a.camera.to_json() == b.camera.to_json()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_photographs(tmp_path, blank_photograph, count):
    for index in range(count):
        blank_photograph(tmp_path / f"{index}.png")
    with pytest.raises(CaptureError, match=f"{count} photographs? found, at least 3"):
        import_captures(tmp_path, None, SETTINGS)


def test_photographs_that_share_nothing(tmp_path, blank_photograph):
    for index in range(3):
        blank_photograph(tmp_path / f"{index}.png", 200, 150)
    with pytest.raises(CaptureError, match="no two of the 3 photographs share") as caught:
        import_captures(tmp_path, None, SETTINGS)
    assert "walk sideways" in caught.value.cure


def test_too_few_of_them_register(tmp_path, room_captures, blank_photograph):
    for capture in room_captures[:3]:
        save_image(tmp_path / capture.name, capture.image())
    for index in range(4):
        blank_photograph(tmp_path / f"stranger{index}.png", 200, 150)
    with pytest.raises(CaptureError, match=r"only \d of 7 photographs.*left out: .*stranger0\.png"):
        import_captures(tmp_path, None, SETTINGS)


def test_an_unreadable_photograph_is_named(tmp_path, room_captures):
    for capture in room_captures[:3]:
        save_image(tmp_path / capture.name, capture.image())
    (tmp_path / "zzz.jpg").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(CaptureError, match=r"zzz\.jpg.*cannot be read"):
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


@pytest.mark.slow
def test_a_photograph_at_a_wrong_place_is_left_out(shared, messages):
    """The sixth capture shares too little with the others to be placed by itself."""
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
