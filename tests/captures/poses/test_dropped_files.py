"""Dropped files are told apart as a person means them."""

from pathlib import Path

import pytest
from expected_errors import refused

from r2sego_blender.captures.poses.dropped_files import PHOTOGRAPHS, capture_files, taken_besides
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import SUFFIXES


@pytest.fixture
def room(tmp_path):
    """A room's folder with photographs, a COLMAP model and a transforms.json."""
    room = tmp_path / "kitchen"
    for name in (
        "images/a.JPG",
        "images/b.png",
        "sparse/0/cameras.bin",
        "sparse/0/images.bin",
        "transforms.json",
        "notes.md",
    ):
        (room / name).parent.mkdir(parents=True, exist_ok=True)
        (room / name).write_bytes(b"")
    return room


@pytest.mark.parametrize(
    ("dropped", "photographs", "poses"),
    [
        (["images/a.JPG", "images/b.png"], "images", None),
        (["images"], "images", None),
        (["sparse/0/cameras.bin"], "images", "sparse/0"),
        (["sparse/0"], "images", "sparse/0"),
        (["sparse"], "images", "sparse/0"),
        (["transforms.json"], "images", "transforms.json"),
        (["transforms.json", "images/a.JPG"], "images", "transforms.json"),
        (["."], "images", "transforms.json"),
    ],
)
def test_what_is_dropped_is_found(room, dropped, photographs, poses):
    found = capture_files([(room / one).resolve() for one in dropped], ".r2s")
    assert found.photographs == room / photographs
    assert found.poses == (None if poses is None else room / poses)
    assert found.scene == room.with_name("kitchen.r2s")


def test_an_archive_is_taken_as_it_is(tmp_path):
    (tmp_path / "scan.ZIP").write_bytes(b"PK")
    found = capture_files([tmp_path / "scan.ZIP"], ".r2s")
    assert (found.photographs, found.poses, found.scene) == (tmp_path / "scan.ZIP", None, tmp_path / "scan.r2s")


def test_a_folder_without_a_name_above_the_photographs(room, monkeypatch):
    """As on a camera's card, whose root has none."""
    monkeypatch.chdir(room)
    assert capture_files([Path("images")], ".r2s").scene == Path("room.r2s")


def test_poses_without_photographs_leave_the_folder_to_the_person(tmp_path):
    (tmp_path / "alone" / "deep" / "deeper").mkdir(parents=True)
    file = tmp_path / "alone" / "deep" / "deeper" / "transforms.json"
    file.write_bytes(b"")
    found = capture_files([file], ".r2s")
    assert found.photographs is None and found.poses == file


def test_a_video_is_taken_as_it_is(room):
    video = room / "walk.MP4"
    video.write_bytes(b"")
    found = capture_files([video], ".r2s")
    assert found.photographs == video and found.poses is None and found.scene == room / "walk.r2s"


@pytest.mark.parametrize("dropped", [["notes.md"], [], ["sparse/0/points.ply"]])
def test_what_is_neither_is_refused(room, dropped):
    with refused(CaptureError, room / dropped[0] if dropped else "dropped files"):
        capture_files([room / one for one in dropped], ".r2s")


def test_an_empty_folder_takes_no_photographs_beside_it(room):
    (room / "empty").mkdir()
    with refused(CaptureError, room / "empty"):
        capture_files([room / "empty"], ".r2s")


def test_photographs_of_two_folders_are_refused(room):
    (room / "more").mkdir()
    (room / "more" / "c.jpg").write_bytes(b"")
    with refused(CaptureError, room / "more", "more than one folder"):
        capture_files([room / "images" / "a.JPG", room / "more" / "c.jpg"], ".r2s")


def test_all_photographs_that_the_engine_reads_can_be_dropped():
    assert set(PHOTOGRAPHS) == SUFFIXES


@pytest.mark.parametrize(("dropped", "told"), [(1, True), (2, True), (3, False), (0, False)])
def test_photographs_of_a_folder_that_were_not_dropped_are_told(tmp_path, dropped, told):
    files = [tmp_path / name for name in ("a.jpg", "b.PNG", "c.jpeg")]
    for file in (*files, tmp_path / "notes.txt", tmp_path / "._a.jpg"):
        file.write_bytes(b"")
    found = capture_files(files[:dropped] or [tmp_path], ".r2s")
    said = taken_besides(files[:dropped], found.photographs)
    assert bool(said) == told and (not told or ("3" in said and str(dropped) in said))


@pytest.mark.parametrize("left", ["walk.MP4", "more.zip"])
def test_a_video_or_zip_dropped_with_photographs_is_told_as_left_out(tmp_path, left):
    files = [tmp_path / name for name in ("a.jpg", "b.jpg", "c.jpg", left)]
    for file in files:
        file.write_bytes(b"")
    found = capture_files(files, ".r2s")
    assert found.photographs == tmp_path and left in taken_besides(files, found.photographs)
    assert taken_besides(files[:3], found.photographs) == ""
    alone = capture_files(files[3:], ".r2s")
    assert alone.photographs == files[3] and taken_besides(files[3:], alone.photographs) == ""
