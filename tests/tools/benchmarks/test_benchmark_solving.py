"""The benchmark of solving chooses of a walk what is asked for, and its errors are those after a similarity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_room import write_painted_room
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError
from tools.benchmarks.solving import bench_solving, chosen_of_walk, lines, pose_errors


def _poses(rng, count=5):
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, random_state=int(rng.integers(1 << 30))).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(count, 3)) * [2.0, 1.0, 0.1]
    return poses


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10.0))
def test_a_similarity_is_no_error_and_what_is_moved_beyond_it_is(seed, scale):
    rng = np.random.default_rng(seed)
    true = _poses(rng)
    similarity = _poses(rng, 1)[0]
    found = similarity @ true
    found[:, :3, 3] *= scale
    off, turned = pose_errors(found, true)
    assert off.max() < 1e-9 and turned.max() < 1e-5
    found[2, :3, :3] = found[2, :3, :3] @ Rotation.from_euler("x", 10.0, degrees=True).as_matrix()
    assert np.argmax(pose_errors(found, true)[1]) == 2


def test_places_along_a_line_tell_a_turn_about_it():
    true = np.tile(np.eye(4), (4, 1, 1))
    true[:, 0, 3] = range(4)
    found = true.copy()
    found[3, :3, :3] = Rotation.from_euler("x", 20.0, degrees=True).as_matrix()
    assert pose_errors(found, true)[1].max() > 10.0


@pytest.mark.slow
def test_each_matcher_is_scored_on_the_photographs_asked_for(tmp_path):
    scene = write_painted_room(tmp_path)
    captures = import_captures(scene, scene / "cameras.json", CaptureSettings()).captures
    assert chosen_of_walk(captures, 1, 2, 1, 0.0) == list(captures[1:3])
    assert len(chosen_of_walk(captures, 0, 12, 1, 181.0)) == 1
    with pytest.raises(CaptureError):
        bench_solving(scene, scene / "cameras.json", count=2)
    figures = bench_solving(scene, scene / "cameras.json")
    assert figures["photographs"] == len(captures) == len(figures["turns_deg"]) + 1
    for name in ("sift", "xfeat"):
        assert figures[name]["failure"] or figures[name]["worst_degrees"] < 3.0
    assert len(lines(figures)) == 5
