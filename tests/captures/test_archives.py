"""Zip archives: those that phones share, and those that nobody should open."""

from __future__ import annotations

import json
import os
import shutil
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st
from phone_recordings import three_d_scanner_app
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.archives import is_archive, unpack
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import to_uint8
from r2sego_blender.core.progress import SILENT
from r2sego_blender.refine.creation import create_scene


def archive(file: Path, members, compression=zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(file, "w", compression) as opened:
        for name, content in members.items():
            opened.writestr(name, content)
    return file


def unpacked(file, place):
    place.mkdir()
    inside = unpack(file, place, SILENT)
    return inside, {str(path.relative_to(inside)): path.read_bytes() for path in inside.rglob("*") if path.is_file()}


@given(
    st.dictionaries(st.from_regex(r"[a-z]{1,3}/[a-z0-9_]{1,8}\.(jpg|json)", fullmatch=True), st.binary(max_size=300))
)
def test_what_was_packed_comes_out(tmp_path_factory, members):
    folder = tmp_path_factory.mktemp("zip")
    members["first.json"] = b"{}"
    file = archive(folder / "scan.zip", {f"2026/scan/{name}": content for name, content in members.items()})
    inside, found = unpacked(file, folder / "out")
    assert inside == folder / "out/2026/scan" and found == members


def test_a_shared_scan_becomes_a_bundle(tmp_path, room, room_cameras):
    images = [to_uint8(room.image(camera)) for camera in room_cameras]
    export = three_d_scanner_app(tmp_path / "share/2026_11_28", room_cameras, images, room.depth)
    shutil.make_archive(str(tmp_path / "scan"), "zip", export.parent)
    with zipfile.ZipFile(tmp_path / "scan.zip", "a") as opened:  # as a Mac does
        opened.writestr("__MACOSX/2026_11_28/._frame_00000.jpg", b"\0" * 99)
    scene = create_scene(tmp_path / "scan.r2s", tmp_path / "scan.zip", settings=CaptureSettings(max_features=2500))
    captures = scene.read(CAPTURES)
    assert len(captures) == 5 and "3D Scanner App" in scene.declaration.captures_source
    turn = captures[0].camera.camera_from_world @ captures[4].camera.world_from_camera
    true = room_cameras[0].camera_from_world @ room_cameras[4].world_from_camera
    assert np.abs(turn - true).max() < 0.02


def test_what_is_wrong_in_it_is_told_of_it(tmp_path, room, room_cameras):
    """No folder that is gone by then."""
    images = [to_uint8(room.image(camera)) for camera in room_cameras]
    export = three_d_scanner_app(tmp_path / "share/today", room_cameras, images, room.depth)
    (export / "frame_00002.json").write_text("{")
    shutil.make_archive(str(tmp_path / "scan"), "zip", export.parent)
    with pytest.raises(CaptureError) as told:
        create_scene(tmp_path / "scan.r2s", tmp_path / "scan.zip")
    assert f"{tmp_path / 'scan.zip'}/today/frame_00002.json" in str(told.value)
    assert "r2sego-" not in str(told.value) and "Unpack" in told.value.cure


@pytest.mark.parametrize("place", ["images/", ""])
def test_photographs_in_a_zip_have_the_poses_that_lie_there(tmp_path, room_captures, place):
    """As nerfstudio lays them out, and straight beside each other."""
    scan = tmp_path / "share/room"
    (scan / place).mkdir(parents=True)
    for capture in room_captures:
        shutil.copy(capture.image_path, scan / place)
    gl = np.diag([1.0, -1.0, -1.0, 1.0])
    frames = [
        {"file_path": f"{place}{c.name}", "transform_matrix": (c.camera.world_from_camera @ gl).tolist()}
        for c in room_captures
    ]
    gone = {**frames[0], "file_path": "gone.png"}
    poses = {"fl_x": 300.0, "metric": True, "frames": [*frames, gone]}
    (scan / "transforms.json").write_text(json.dumps(poses))
    shutil.make_archive(str(tmp_path / "scan"), "zip", scan.parent)
    settings, told = CaptureSettings(max_side_px=160, matcher="sift"), ProgressRecorder()
    scene = create_scene(tmp_path / "scan.r2s", tmp_path / "scan.zip", settings=settings, progress=told)
    (warned,) = (text for text in told.warnings if "gone.png" in text)
    assert f"{tmp_path / 'scan.zip'}/room" in warned and told.tasks
    found = [capture.camera.centre for capture in scene.read(CAPTURES)]
    true = [capture.camera.centre for capture in room_captures]
    apart = [np.linalg.norm(np.subtract(places[0], places[-1])) for places in (found, true)]
    assert len(found) == len(room_captures) and apart[0] == pytest.approx(apart[1], abs=0.02)


def test_of_one_video_it_is_the_video(tmp_path):
    file = archive(tmp_path / "walk.zip", {"today/walk.MOV": b"1"})
    (tmp_path / "in").mkdir()
    assert unpack(file, tmp_path / "in", SILENT) == tmp_path / "in/today/walk.MOV"


@pytest.mark.parametrize("name", ["../out.jpg", "a/../../out.jpg", "/out.jpg", "..\\out.jpg", "C:\\out.jpg", "a/.."])
def test_names_that_lead_out_are_refused(tmp_path, name):
    file = archive(tmp_path / "scan.zip", {"a.jpg": b"1", name: b"2"})
    before = sorted(tmp_path.rglob("*"))
    with refused(CaptureError):
        unpacked(file, tmp_path / "in")
    assert sorted(path for path in tmp_path.rglob("*") if (tmp_path / "in") not in (path, *path.parents)) == before


def test_a_link_is_not_made(tmp_path):
    file = tmp_path / "scan.zip"
    with zipfile.ZipFile(file, "w") as opened:
        link = zipfile.ZipInfo("away.jpg")
        link.external_attr = 0o120777 << 16
        opened.writestr(link, "/etc/passwd")
        opened.writestr("a.jpg", b"1")
    assert unpacked(file, tmp_path / "in")[1] == {"a.jpg": b"1"}


def test_bombs_are_refused_before_they_are_unpacked(tmp_path):
    file = archive(tmp_path / "scan.zip", {f"{i}.png": bytes(10 << 20) for i in range(10)})
    with refused(CaptureError):
        unpacked(file, tmp_path / "in")
    assert not list((tmp_path / "in").iterdir())


def test_a_size_that_is_not_so_is_not_believed(tmp_path):
    """One that says it is small is unpacked no further than it says."""
    file = archive(tmp_path / "scan.zip", {"a.png": bytes(80 << 20)})
    content = file.read_bytes()
    told = struct.pack("<I", 80 << 20)
    assert content.count(told) == 2
    file.write_bytes(content.replace(told, struct.pack("<I", 1000)))
    with refused(CaptureError):
        unpacked(file, tmp_path / "in")
    assert sum(path.stat().st_size for path in (tmp_path / "in").rglob("*") if path.is_file()) <= 1000


def test_a_long_list_of_files_is_refused_before_it_is_read(tmp_path):
    file = archive(tmp_path / "scan.zip", {"a.jpg": b"1"})
    content = bytearray(file.read_bytes())
    struct.pack_into("<I", content, content.rindex(b"PK\5\6") + 12, 33 << 20)
    file.write_bytes(content)
    with refused(CaptureError):
        unpacked(file, tmp_path / "in")


def test_what_is_damaged_or_encrypted_or_none_is_refused(tmp_path, rng):
    whole = archive(tmp_path / "scan.zip", {"a.jpg": rng.bytes(5000), "b.jpg": rng.bytes(5000)}).read_bytes()
    for number, cut in enumerate(range(0, len(whole), 997)):
        (tmp_path / "cut.zip").write_bytes(whole[:cut])
        with refused(CaptureError):
            unpacked(tmp_path / "cut.zip", tmp_path / f"cut_{number}")
    changed = bytearray(whole)
    changed[2000] ^= 255
    (tmp_path / "changed.zip").write_bytes(changed)
    with refused(CaptureError):
        unpacked(tmp_path / "changed.zip", tmp_path / "changed")
    encrypted = bytearray(whole)
    for head, place in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        encrypted[encrypted.index(head) + place] |= 1
    (tmp_path / "encrypted.zip").write_bytes(encrypted)
    with refused(CaptureError):
        unpacked(tmp_path / "encrypted.zip", tmp_path / "encrypted")
    assert not is_archive(tmp_path / "none.zip") and not is_archive(tmp_path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.zip")
        assert not is_archive(tmp_path / "pipe.zip")
