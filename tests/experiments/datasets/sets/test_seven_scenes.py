"""7-Scenes: its own lists of sequences, and depth only of captures."""

from __future__ import annotations

import pytest
from dataset_folders import seven_scenes

from r2sego_blender.core.progress import SILENT
from r2sego_blender.experiments.datasets.sets.seven_scenes import scenes, split


@pytest.fixture(scope="module")
def chess(tmp_path_factory):
    return seven_scenes(tmp_path_factory.mktemp("set") / "chess", frames=3)


def test_captures_are_of_the_training_sequences_and_held_out_frames_of_the_others(chess):
    assert scenes(chess.parent) == scenes(chess) == {"chess": chess}
    found = split(chess, "chess", 4, SILENT)
    names = [one.name for one in found.captures]
    assert names == [f"seq-{a}/frame-00000{b}.color.png" for a, b in (("01", 0), ("01", 2), ("03", 0), ("03", 2))]
    assert [one.name for one in found.frozen] == [f"seq-02/frame-00000{number}.color.png" for number in range(3)]
    assert set(found.depth) == set(names) and all(file.name.endswith(".depth.png") for file in found.depth.values())
    assert "6 frames of TrainSplit.txt" in found.protocol and "3 of TestSplit.txt" in found.protocol


def test_of_a_long_list_sixty_are_held_out(tmp_path, chess):
    for name in ("seq-01", "seq-03", "TrainSplit.txt"):
        (tmp_path / name).symlink_to(chess / name)
    (tmp_path / "seq-02").mkdir()
    for number in range(100):
        for suffix in ("color.png", "pose.txt"):
            (tmp_path / f"seq-02/frame-{number:06d}.{suffix}").symlink_to(chess / f"seq-02/frame-000000.{suffix}")
    (tmp_path / "TestSplit.txt").write_text("sequence2")
    found = [one.path.name for one in split(tmp_path, "chess", 3, SILENT).frozen]
    assert len(set(found)) == 60 and (found[0][6:12], found[-1][6:12]) == ("000000", "000099")
