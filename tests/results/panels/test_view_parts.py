"""Which pictures there are of a generated view, and the frozen view nearest to it."""

import json

import fake_bundle
import fake_views
import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError, GenerationError
from r2sego_blender.results.panels.view_parts import (
    KINDS,
    clip_files,
    nearest_truth,
    require_view,
    view_parts,
    views_of_round,
)

POSE = look_at((0.0, 0.0, 1.0), (1.0, 0.0, 1.0))


@pytest.fixture
def records(bundle):
    return views_of_round(bundle, 0)


def test_the_views_of_a_round_are_read(bundle, records):
    assert [record.candidate for record in records] == [*fake_bundle.TARGETS, 22]
    assert [record.accepted for record in records] == [True, False, True, True]
    assert (records[1].replaced_by, records[3].replaces) == (3, 1)
    assert views_of_round(bundle, 7) == []


def test_parts_come_in_their_order_with_their_words(bundle, records, tmp_path):
    picture = tmp_path / "asset.png"
    picture.touch()
    parts = view_parts(bundle, records[0], KINDS, asset={"asset before": picture}, truth=("truth", picture))
    assert [part.kind for part in parts] == list(KINDS)
    assert [part.label for part in parts if part.kind in ("asset", "reference", "clip")] == [
        "asset before",
        "reference capture_1",
        "clip, frame 2 of 3",
    ]
    assert all(part.file.is_file() for part in parts)


def test_a_frame_of_the_clip_can_be_chosen(bundle, records):
    files = clip_files(records[0].folder)
    assert len(files) == fake_views.CLIP_FRAMES
    for asked, got in ((0, 0), (3, 3), (99, 3)):
        (part,) = view_parts(bundle, records[0], ["clip"], clip_frame=asked)
        assert part.file == files[got]


def test_what_is_missing_is_left_out(bundle, records, tmp_path):
    assert [part.kind for part in view_parts(bundle, records[1], KINDS)] == ["reference"]
    gone = {"asset": tmp_path / "gone.png"}
    assert [part.kind for part in view_parts(bundle, records[0], ["asset", "frame"], asset=gone)] == ["frame"]


def test_a_view_is_found_by_its_rank(records):
    assert require_view(records, 2) is records[2]
    with pytest.raises(GenerationError, match="no generated view 9"):
        require_view(records, 9)


def write_frozen(folder, *poses):
    entries = []
    for index, pose in enumerate(poses):
        (folder / f"ego{index}.png").touch()
        entries.append({"file": f"ego{index}.png", "world_from_camera": pose.tolist()})
    file = folder / "cameras.json"
    file.write_text(json.dumps({"captures": [], "frozen": entries}))
    return file


def test_the_nearest_frozen_view_is_taken_and_its_distance_told(tmp_path):
    near = look_at((0.1, 0.0, 1.0), (1.1, 0.1, 1.0))
    file = write_frozen(tmp_path, look_at((0.3, 0.0, 1.0), (1.0, 0.0, 1.0)), near)
    label, picture = nearest_truth(file, np.eye(4), POSE)
    assert picture == tmp_path / "ego1.png"
    assert label == "truth ego1, 0.10 m, 6 deg off"


def test_frozen_views_are_taken_to_the_world(tmp_path):
    world_from_capture = np.diag([2.0, 2.0, 2.0, 1.0])
    world_from_capture[:3, 3] = 1.0, -2.0, 0.5
    placed = np.linalg.inv(world_from_capture) @ POSE
    placed[:3, :3] = POSE[:3, :3]
    label, _ = nearest_truth(write_frozen(tmp_path, placed), world_from_capture, POSE)
    assert label == "truth ego0, 0.00 m, 0 deg off"


def test_none_is_near_enough(tmp_path):
    away = look_at((0.6, 0.0, 1.0), (1.0, 0.0, 1.0))
    turned = look_at((0.0, 0.0, 1.0), (0.5, 1.0, 1.0))
    assert nearest_truth(write_frozen(tmp_path, away, turned), np.eye(4), POSE) is None


def test_a_file_without_frozen_views_is_an_error(tmp_path):
    file = tmp_path / "cameras.json"
    file.write_text('{"captures": []}')
    with pytest.raises(CaptureError, match="frozen"):
        nearest_truth(file, np.eye(4), POSE)


def test_a_missing_photograph_is_an_error(tmp_path):
    file = write_frozen(tmp_path, POSE)
    (tmp_path / "ego0.png").unlink()
    with refused(CaptureError, "cameras.json, frozen[0]", "missing"):
        nearest_truth(file, np.eye(4), POSE)


@pytest.mark.parametrize("name", ["../secret.png", "a/../../secret.png", "..\\secret.png", "{}/secret.png"])
def test_a_photograph_elsewhere_is_looked_up_by_its_name(tmp_path, name):
    """As the importer has it: a file from a stranger shows nothing that lies outside its folder."""
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"secret")
    (tmp_path / "room").mkdir()
    file = write_frozen(tmp_path / "room", POSE)
    file.write_text(json.dumps({"frozen": [{"file": name.format(tmp_path), "world_from_camera": POSE.tolist()}]}))
    with refused(CaptureError, "cameras.json, frozen[0]", "missing"):
        nearest_truth(file, np.eye(4), POSE)
    (file.parent / "secret.png").write_bytes(b"the room's own")
    assert nearest_truth(file, np.eye(4), POSE)[1] == file.parent / "secret.png"


@pytest.mark.parametrize("name", ["a" * 300 + ".png", "a\0b.png"])
def test_a_name_that_no_file_has_is_missing(tmp_path, name):
    file = write_frozen(tmp_path, POSE)
    file.write_text(json.dumps({"frozen": [{"file": name, "world_from_camera": POSE.tolist()}]}))
    with refused(CaptureError, "cameras.json, frozen[0]", "missing"):
        nearest_truth(file, np.eye(4), POSE)
