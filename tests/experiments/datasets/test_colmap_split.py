"""COLMAP folders that say which photographs are held out, in each way in circulation."""

from __future__ import annotations

import json

import numpy as np
import pytest
from dataset_folders import colmap_split, pose
from expected_errors import refused

from r2sego_blender.core.errors import CaptureError, ExperimentError
from r2sego_blender.core.progress import SILENT
from r2sego_blender.experiments.datasets.colmap_split import holds_split, read_lists, read_split

LEARNT, HELD_OUT = (5, 80, 187, 392), (75, 90, 200)


@pytest.mark.parametrize("way", ["apart", "test.txt", "json"])
def test_both_parts_are_read_with_their_poses(tmp_path, way):
    folder = colmap_split(tmp_path, LEARNT, HELD_OUT, way)
    assert holds_split(folder)
    for found, numbers in zip(read_split(folder, SILENT), (LEARNT, HELD_OUT), strict=True):
        assert [one.name for one in found] == [f"rgb_{number}.png" for number in numbers]
        for one, number in zip(found, numbers, strict=True):
            assert one.path.is_file() and np.abs(one.world_from_camera - pose(number)).max() < 1e-9
            assert (one.lens.fx, one.lens.cx) == (8.0, 8.0)


def test_a_list_of_some_leaves_the_rest_out(tmp_path):
    folder = colmap_split(tmp_path, LEARNT, HELD_OUT, "lists")
    (folder / "train.txt").write_text("# two of them\nrgb_392.png\nrgb_5\nimages\\rgb_5.png\n")
    learnt, held_out = read_split(folder, SILENT)
    assert [one.name for one in learnt] == ["rgb_5.png", "rgb_392.png"] and len(held_out) == 3


def test_what_holds_no_split_is_none(tmp_path):
    folder = colmap_split(tmp_path, LEARNT, HELD_OUT, "test.txt")
    (folder / "sparse/0/test.txt").unlink()
    assert not holds_split(folder) and not holds_split(tmp_path / "nothing")


def test_what_is_wrong_is_told_by_its_place(tmp_path):
    folder = colmap_split(tmp_path, LEARNT, HELD_OUT, "test.txt")
    (folder / "sparse/0/test.txt").write_text("rgb_75.png\nrgb_76.png\n")
    with refused(ExperimentError, "test.txt", "rgb_76.png"):
        read_split(folder, SILENT)
    lists = folder / "train_test_lists.json"
    for told in ({"train": ["a"]}, {"train": ["a"], "test": [1]}, {"train": "a", "test": []}):
        lists.write_text(json.dumps(told))
        with refused(ExperimentError, lists):
            read_lists(lists)
    lists.write_text("[")
    with refused(CaptureError, lists):
        read_lists(lists)
