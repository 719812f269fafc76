"""Replica in its layouts: the published captures and held-out frames where they can be followed."""

from __future__ import annotations

import pytest
from dataset_folders import colmap_split, nice_slam, semantic_nerf
from expected_errors import refused

from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.core.progress import SILENT
from r2sego_blender.experiments.datasets.sets.replica import scenes, split

OFFICE_2 = (244, 291, 436, 607, 760, 831)


def numbers(photographs):
    return [int("".join(filter(str.isdigit, one.name.rpartition(".")[0]))) for one in photographs]


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    semantic_nerf(data / "office_2/Sequence_2", 900)
    semantic_nerf(data / "office_2/Sequence_1", 20)
    return data


def test_the_published_split_is_followed(walk):
    assert scenes(walk) == {"office_2": walk / "office_2"}
    found = split(walk / "office_2", "office_2", 6, SILENT)
    assert numbers(found.captures) == list(OFFICE_2) and "GuidedVD-3DGS" in found.protocol
    held_out = numbers(found.frozen)
    assert len(held_out) == 57 and (held_out[0], held_out[-1]) == (194, 872)  # as GaMO passes them on
    assert {241, 245, 332, 386, 648, 710, 801, 832} <= set(held_out) and not found.depth


def test_other_counts_and_scenes_are_equally_spaced_with_the_same_rule(walk, tmp_path):
    found = split(walk / "office_2", "office_2", 3, SILENT)
    assert numbers(found.captures)[0] == 0 and len(found.captures) == 3 and "equally spaced" in found.protocol
    semantic_nerf(tmp_path / "office_0", 90)
    found = split(tmp_path / "office_0", "office_0", 6, SILENT)
    assert numbers(found.captures) == [0, 18, 36, 53, 71, 89]
    at = (0, 18, 36, 53, 71, 89)
    held_out = numbers(found.frozen)
    assert {max(0, one - 5) for one in at[1:]} <= set(held_out) and not set(held_out) & set(at)
    assert all(min(abs(one - other) for other in at) <= 5 for one in held_out)


def test_nice_slams_rooms_have_their_names_and_the_same_share_of_a_longer_walk(tmp_path):
    nice_slam(tmp_path / "office2", 40, (12, 8))
    nice_slam(tmp_path / "room0", 6, (12, 8))
    found = scenes(tmp_path)
    assert found == {"office_2": tmp_path / "office2", "room_0": tmp_path / "room0"}
    one = split(found["office_2"], "office_2", 6, SILENT)
    assert numbers(one.captures) == [0, 8, 16, 23, 31, 39] and "published" not in one.protocol
    assert all(min(abs(frame - at) for at in numbers(one.captures)) <= 2 for frame in numbers(one.frozen))
    with refused(ExperimentError, "traj.txt", "7", "6"):
        split(found["room_0"], "room_0", 7, SILENT)


def test_a_folders_own_split_goes_before_the_walk_beside_it(tmp_path):
    folder = colmap_split(tmp_path / "office_2", OFFICE_2, (194, 204, 245), "apart")
    semantic_nerf(folder, 900, kept=(0, 1, 2))
    found = split(scenes(tmp_path)["office_2"], "office_2", 6, SILENT)
    assert numbers(found.captures) == list(OFFICE_2) and numbers(found.frozen) == [194, 204, 245]
    assert scenes(folder) == {"office_2": folder} and scenes(tmp_path / "nothing") == {}


def test_a_frame_that_the_protocol_needs_is_asked_for(tmp_path):
    semantic_nerf(tmp_path / "office_2", 900, kept=(244, 291, 436, 607, 760, 830))
    with refused(ExperimentError, "traj_w_c.txt", "831"):
        split(tmp_path / "office_2", "office_2", 6, SILENT)
