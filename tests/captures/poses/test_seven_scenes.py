"""7-Scenes: poses, lens and lists as the set's own page says."""

from __future__ import annotations

import numpy as np
import pytest
from dataset_folders import pose, seven_scenes
from expected_errors import refused

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.registry import find_poses
from r2sego_blender.captures.poses.seven_scenes import frames_in, posed_frame, sequences
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError

SETTINGS = CaptureSettings()


@pytest.fixture(scope="module")
def chess(tmp_path_factory):
    return seven_scenes(tmp_path_factory.mktemp("set") / "chess", frames=3)


def test_of_a_scene_the_training_sequences_are_read_and_no_depth(chess):
    imported = import_captures(chess, None, SETTINGS)
    assert imported.metric and imported.depth is None
    numbers = [100, 101, 102, 300, 301, 302]
    assert [one.name for one in imported.captures] == [
        f"seq-{n // 100:02d}/frame-{n % 100:06d}.color.png" for n in numbers
    ]
    for number, capture in zip(numbers, imported.captures, strict=True):
        assert np.abs(capture.camera.world_from_camera - pose(number)).max() < 1e-8
        assert (capture.camera.fx, capture.camera.cx, capture.camera.cy) == (585.0, 320.0, 240.0)


def test_a_sequence_is_read_alone(chess):
    assert find_poses(chess / "seq-02")[1] == chess / "seq-02"
    found = import_captures(chess / "seq-02", None, SETTINGS).captures
    assert [one.name for one in found] == [f"frame-{number:06d}.color.png" for number in range(3)]


@pytest.mark.parametrize("line", ["sequence1", "seq-01", "Sequence01 ", "1"])
def test_lists_are_read_as_they_are_written(tmp_path, chess, line):
    (tmp_path / "seq-01").symlink_to(chess / "seq-01")
    (tmp_path / "TrainSplit.txt").write_text(f"# to learn from\n\n{line}\n")
    assert sequences(tmp_path, "TrainSplit.txt") == [tmp_path / "seq-01"]
    (tmp_path / "seq-01").unlink()
    (tmp_path / "seq-01").mkdir()
    (tmp_path / "seq-01/seq-01").symlink_to(chess / "seq-01")
    assert len(frames_in(*sequences(tmp_path, "TrainSplit.txt"))) == 3


def test_what_is_wrong_is_told_by_its_place(tmp_path, chess):
    for text, what in (("sequence7", "seq-07"), ("../../etc", "../../etc"), ("sequence1\nseq-01", "seq-01")):
        (tmp_path / "TrainSplit.txt").write_text(text)
        with refused(CaptureError, "", what):
            sequences(tmp_path, "TrainSplit.txt")
    frame = tmp_path / "frame-000000.color.png"
    frame.write_bytes(frames_in(chess / "seq-01")[0].read_bytes())
    for text in (None, "1 0 0 0\n0 1 0 0", "inf " * 16):
        if text is not None:
            (tmp_path / "frame-000000.pose.txt").write_text(text)
        with refused(CaptureError, "frame-000000.pose.txt"):
            posed_frame(frame)
