"""ScanNet++: its own held-out photographs, undistorted ones first."""

from __future__ import annotations

import json

from dataset_folders import scannetpp
from expected_errors import refused

from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.core.progress import SILENT
from r2sego_blender.experiments.datasets.sets.scannetpp import scenes, split


def names(photographs):
    return [int(one.name[3:8]) for one in photographs]


def test_the_split_is_the_sets_own(tmp_path):
    room = tmp_path / "data/8b5caf3398"
    scannetpp(room, train=9, test=3)
    assert scenes(tmp_path) == scenes(tmp_path / "data") == scenes(room) == {"8b5caf3398": room}
    found = split(room, room.name, 3, SILENT)
    assert (names(found.captures), names(found.frozen)) == ([0, 4, 8], [9, 10, 11])
    assert found.captures[0].lens.model == "opencv_fisheye" and not found.depth
    lists = {
        "train": [f"DSC{n:05d}.JPG" for n in range(0, 9, 2)],
        "test": ["DSC00011.JPG", "DSC00003.JPG", "DSC99999.JPG"],
    }
    (room / "dslr/train_test_lists.json").write_text(json.dumps(lists))
    found = split(room, room.name, 3, SILENT)
    assert (names(found.captures), names(found.frozen)) == ([0, 4, 8], [3, 11])


def test_what_the_sets_program_undistorted_is_taken(tmp_path):
    scannetpp(tmp_path / "a")
    scannetpp(tmp_path / "a", images="undistorted_images")
    found = split(scenes(tmp_path)["a"], "a", 3, SILENT)
    assert all(one.lens.plain and "undistorted_images" in str(one.path) for one in (*found.captures, *found.frozen))


def test_photographs_that_are_kept_back_are_told(tmp_path):
    file = scannetpp(tmp_path / "a", test=0)
    file.write_text(
        json.dumps({key: value for key, value in json.loads(file.read_text()).items() if key != "test_frames"})
    )
    with refused(ExperimentError, tmp_path / "a", "held-out"):
        split(tmp_path / "a", "a", 3, SILENT)
