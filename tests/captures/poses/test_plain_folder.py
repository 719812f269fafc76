"""What is taken of a phone's folder, and what is said of the rest."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from expected_errors import refused
from PIL import Image

from r2sego_blender.captures.poses.plain_folder import plain_photographs
from r2sego_blender.captures.poses.registry import find_poses
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.progress import SILENT


@pytest.fixture
def folder(tmp_path, blank_photograph):
    for index in range(3):
        blank_photograph(tmp_path / f"IMG_{index}.png")
    return tmp_path


def _names(paths):
    return [path.name for path in paths]


def test_a_plain_folder_is_taken_whole_and_nothing_is_said(folder, messages):
    for name in (".DS_Store", "Thumbs.db", "._IMG_0.png", ".hidden.heic", "notes.txt"):
        (folder / name).write_bytes(b"\x00")
    assert _names(plain_photographs(folder, messages)) == ["IMG_0.png", "IMG_1.png", "IMG_2.png"]
    assert messages.messages == []


def _depth_map(path, kind="png"):
    path.parent.mkdir(exist_ok=True)
    depth_mm = np.linspace(500, 4000, 64 * 48).reshape(48, 64)
    values = depth_mm.astype(np.uint16) if kind == "png" else (depth_mm / 1000).astype(np.float32)
    Image.fromarray(values).save(path.with_suffix(f".{kind}"))


@pytest.mark.parametrize("kind", ["png", "tiff"])
def test_depth_maps_beside_photographs_are_passed_over_and_named(folder, messages, kind):
    """As 7-Scenes lays them out; a grey photograph has 8 bits and stays one."""
    for index in range(3):
        _depth_map(folder / f"IMG_{index}_depth", kind)
    Image.open(folder / "IMG_0.png").convert("L").save(folder / "grey.png")
    assert _names(plain_photographs(folder, messages)) == ["IMG_0.png", "IMG_1.png", "IMG_2.png", "grey.png"]
    [(_, told)] = messages.messages
    assert all(f"IMG_{index}_depth.{kind}" in told for index in range(3)) and "depth maps" in told


def test_photographs_of_16_bits_alone_are_photographs(tmp_path, messages):
    for index in range(3):
        values = np.random.default_rng(index).integers(0, 65536, (48, 64)).astype(np.uint16)
        Image.fromarray(values).save(tmp_path / f"{index}.png")
    assert len(plain_photographs(tmp_path, messages)) == 3 and messages.messages == []


def test_a_folder_of_depth_maps_is_not_pointed_to(tmp_path, blank_photograph):
    """TUM's layout."""
    for index in range(3):
        blank_photograph(tmp_path / "rgb" / f"{index}.png")
        _depth_map(tmp_path / "depth" / f"{index}")
    with refused(CaptureError, tmp_path, "0 photographs", "some in rgb", cure="Give that folder.") as caught:
        plain_photographs(tmp_path, SILENT)
    assert "depth" not in caught.value.what


def test_copies_of_a_photograph_are_taken_once(folder, messages):
    shutil.copyfile(folder / "IMG_1.png", folder / "IMG_1 (1).png")
    (folder / "linked.png").hardlink_to(folder / "IMG_2.png")
    assert _names(plain_photographs(folder, messages)) == ["IMG_0.png", "IMG_1.png", "IMG_2.png"]
    assert messages.warnings == ["IMG_1 (1).png, linked.png: the same photograph again, left out"]


def test_copies_do_not_make_up_for_photographs(tmp_path, blank_photograph):
    blank_photograph(tmp_path / "a.png")
    for name in "bcd":
        shutil.copyfile(tmp_path / "a.png", tmp_path / f"{name}.png")
    with refused(CaptureError, tmp_path, "1 photograph found", "b.png, c.png, d.png are the same"):
        plain_photographs(tmp_path, SILENT)


def test_pictures_that_are_not_read_are_named(folder, messages):
    """But not the raw file and the video that a camera writes beside a photograph."""
    for name in ("IMG_0.DNG", "IMG_0.MOV", "DSC_7.NEF", "DSC_7.MOV", "walk.mp4", "b.jxl"):
        (folder / name).write_bytes(b"\x00")
    assert len(plain_photographs(folder, messages)) == 3
    [warning] = messages.warnings
    assert warning.startswith("DSC_7.NEF, b.jxl, walk.mp4: passed over. Save them as JPEG")
    assert "frames" in warning


def test_a_folder_of_raw_files_alone_is_told_with_its_cure(tmp_path):
    for index in range(6):
        (tmp_path / f"IMG_{index}.DNG").write_bytes(b"\x00")
    with refused(CaptureError, tmp_path, "0 photographs", "IMG_3.DNG and 2 more", cure="Save them as JPEG"):
        plain_photographs(tmp_path, SILENT)


def test_iphones_photographs_are_taken_each_once(tmp_path, blank_photograph, messages):
    """Of one that was converted the JPEG; and no video that was taken with one is told."""
    for index in range(4):
        picture = Image.open(blank_photograph(tmp_path / "blank.png"))
        picture.save(tmp_path / f"IMG_{index}.HEIC")
        (tmp_path / f"IMG_{index}.MOV").write_bytes(b"\x00")
    picture.save(tmp_path / "IMG_3.JPG")
    (tmp_path / "blank.png").unlink()
    found = _names(plain_photographs(tmp_path, messages))
    assert found == ["IMG_0.HEIC", "IMG_1.HEIC", "IMG_2.HEIC", "IMG_3.JPG"]
    assert messages.messages == []


def test_photographs_in_folders_below_are_pointed_to(tmp_path, blank_photograph):
    for index in range(3):
        blank_photograph(tmp_path / "holiday" / f"IMG_{index}.png")
    with refused(CaptureError, tmp_path, "0 photographs", "some in holiday", cure="Give that folder."):
        plain_photographs(tmp_path, SILENT)


POSES = {
    "transforms.json": {"transforms.json": '{"frames": []}'},
    "cameras.json": {"cameras.json": '[{"rotation": []}]'},  # of 3DGS
    "sparse/0": {"sparse/0/cameras.bin": "", "sparse/0/images.bin": ""},
}


def _poses(place, name):
    for file, content in POSES[name].items():
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        (place / file).write_text(content)
    return place / name


@pytest.mark.parametrize("above", [False, True])
@pytest.mark.parametrize("name", POSES)
def test_poses_that_are_not_used_are_told_by_what_takes_them(folder, messages, name, above, monkeypatch):
    """But not those in the system's folder of temporary files, in which a video's frames lie."""
    photographs = folder
    if above:
        (photographs := folder / "images").mkdir()
        for file in sorted(folder.glob("*.png")):
            file.rename(photographs / file.name)
    poses = _poses(folder, name)
    plain_photographs(photographs, messages)
    assert len(messages.warnings) == 1 and f"`--poses {poses}`" in messages.warnings[0]
    assert find_poses(poses)[1] == poses
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    plain_photographs(photographs, messages)
    assert len(messages.warnings) == (1 if above else 2)


def test_photographs_in_a_folder_below_are_pointed_to_with_their_poses(tmp_path, blank_photograph):
    for name in ("cover.png", *(f"images/{index}.png" for index in range(3))):
        blank_photograph(tmp_path / name)
    poses = _poses(tmp_path, "transforms.json")
    with refused(CaptureError, tmp_path, "1 photograph", "some in images", cure=f"`--poses {poses}`"):
        plain_photographs(tmp_path, SILENT)


def test_of_files_that_are_no_images_all_are_counted(folder):
    for name in ("IMG_1.png", "IMG_3.png", "IMG_4.JPG"):
        (folder / name).write_bytes(b"")
    with refused(CaptureError, folder / "IMG_1.png", "2 more of the 5", "IMG_3.png, IMG_4.JPG"):
        plain_photographs(folder, SILENT)


def test_a_file_that_is_no_image_is_told_before_any_work(folder):
    (folder / "IMG_9.JPG").write_bytes(b"")
    with refused(CaptureError, folder / "IMG_9.JPG"):
        plain_photographs(folder, SILENT)


@pytest.mark.parametrize("name", ["IMG_\x1b[2J.png", "IMG_\x07.png", "IMG_\u202egnp.png"])
def test_a_name_that_controls_a_terminal_is_refused_in_words_that_do_not(folder, name):
    (folder / "IMG_1.png").rename(folder / name)
    with pytest.raises(CaptureError, match="characters that cannot be shown") as caught:
        plain_photographs(folder, SILENT)
    assert str(caught.value).isprintable() and "Rename" in caught.value.cure
