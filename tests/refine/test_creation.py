"""Making a bundle: what is looked at before anything is worked on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from expected_errors import refused
from progress_recorder import ProgressRecorder

from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image
from r2sego_blender.refine.creation import create_scene


def save_unlike(folder: Path) -> None:
    """Three photographs that have nothing in common."""
    folder.mkdir()
    for index in range(3):
        save_image(folder / f"IMG_{index}.png", np.random.default_rng(index).random((48, 64, 3)))


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (Scale.known_length("IMG_7.png", (1, 1), (9, 9), 1.0), "no capture 'IMG_7.png'"),
        (Scale.known_length("IMG_1", (1, 1), (900, 9), 1.0), "a pixel lies outside the 64x48 photograph"),
        (Scale.marker(0.2), "the marker was found in 0 captures, two are needed"),
        (Scale.depth(Path("nowhere")), "nowhere: there is no such folder"),
        (Scale.known_length("IMG_1", (1, 1), (9, 9), 1.0), "no two of the 3 photographs"),
    ],
)
def test_a_scale_that_cannot_be_is_told_before_poses_are_solved(tmp_path, scale, message):
    """The photographs have nothing in common, so that solving them fails, and says so."""
    save_unlike(tmp_path / "photos")
    with pytest.raises(CaptureError, match=message):
        create_scene(tmp_path / "room.r2s", tmp_path / "photos", scale=scale)
    assert not (tmp_path / "room.r2s").exists()


@pytest.mark.parametrize("named", [0, 1, 2])
def test_depth_maps_called_otherwise_are_told_before_poses_are_solved(tmp_path, named):
    save_unlike(tmp_path / "photos")
    (tmp_path / "depth").mkdir()
    for index in range(3):
        np.save(tmp_path / "depth" / (f"IMG_{index}.npy" if index < named else f"depth_{index}.npy"), np.ones((48, 64)))
    expected = "no two of the 3 photographs" if named == 2 else rf"depth: .*of {named} of 3 photographs.*IMG_0\.png"
    with pytest.raises(CaptureError, match=expected):
        create_scene(tmp_path / "room.r2s", tmp_path / "photos", scale=Scale.depth(tmp_path / "depth"))


@pytest.mark.parametrize("place", ["masks", "photos/masks"])
def test_masks_beside_the_photographs_are_told_with_the_command_that_reads_them(tmp_path, place):
    save_unlike(tmp_path / "photos")
    (tmp_path / place).mkdir()
    told, scene = ProgressRecorder(), tmp_path / "room.r2s"
    with pytest.raises(CaptureError, match="no two of the 3 photographs"):
        create_scene(scene, tmp_path / "photos", progress=told)
    (line,) = [text for _, text in told.messages if "masks" in text]
    assert line.startswith(f"{tmp_path / place} is not read: ")
    assert f"`r2sego objects {scene} --masks {tmp_path / place}`" in line


def test_what_record3d_keeps_for_itself_is_refused_with_what_it_exports(tmp_path):
    (tmp_path / "room.r3d").write_bytes(b"PK")
    with refused(CaptureError, tmp_path / "room.r3d", cure="EXR"):
        create_scene(tmp_path / "room.r2s", tmp_path / "room.r3d")


def test_a_script_may_give_texts_for_paths(tmp_path):
    (tmp_path / "photos").mkdir()
    with pytest.raises(CaptureError, match=r"nowhere.*there is no such folder"):
        create_scene(str(tmp_path / "room.r2s"), str(tmp_path / "nowhere"))
    with pytest.raises(CaptureError, match=r"poses\.json"):
        create_scene(str(tmp_path / "room.r2s"), str(tmp_path / "photos"), str(tmp_path / "poses.json"))


def test_poses_are_not_of_a_videos_frames(tmp_path):
    video, poses = tmp_path / "walk.mp4", tmp_path / "cameras.json"
    video.write_bytes(b"")
    poses.write_text("{}")
    with refused(CaptureError, poses, "frames of a video"):
        create_scene(tmp_path / "room.r2s", video, poses)
