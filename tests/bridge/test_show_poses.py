"""The outlines of a trial stand where the plan says, facing the way it says."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from r2sego_blender.bridge.trials.show_poses import move_poses, show_poses  # noqa: E402


def _points(shown):
    """(P, 2) all points of its curve in the world."""
    bpy.context.view_layer.update()
    places = [shown.matrix_world @ point.co.to_3d() for spline in shown.data.splines for point in spline.points]
    assert max(abs(place.z) for place in places) < 1e-6
    return np.array([place[:2] for place in places])


@pytest.mark.parametrize("turn", [0.0, 90.0, -143.0])
def test_outlines_reach_farthest_the_way_they_face(scene, tmp_path, turn):
    robot, chair = show_poses(scene, tmp_path / "a.trials", "trial 3", (1.5, -0.5, turn), (0.2, 0.4, turn), "Stool")
    forward = np.array([math.cos(math.radians(turn)), math.sin(math.radians(turn))])
    for shown, centre in ((robot, (1.5, -0.5)), (chair, (0.2, 0.4))):
        ways = _points(shown) - centre
        farthest = ways[np.linalg.norm(ways, axis=1).argmax()]
        np.testing.assert_allclose(farthest / np.linalg.norm(farthest), forward, atol=1e-5)
        across = ways @ np.array([-forward[1], forward[0]])
        assert across.max() == pytest.approx(-across.min(), abs=1e-5)  # neither side is another
    assert "trial 3" in robot.name and chair.name.startswith("Stool")


def test_copies_stay_where_they_are_in_the_next_trial(scene, tmp_path):
    study = tmp_path / "a.trials"
    robot, chair = show_poses(scene, study, "trial 1", (0.0, 0.0, 0.0), (1.0, 0.5, 180.0), "Chair")
    copy = chair.copy()
    chair.users_collection[0].objects.link(copy)
    copy.location.x = 3.0
    moved = move_poses(scene, study, "trial 2", (0.5, 0.0, 0.0), (2.0, 0.5, 90.0), "Chair")
    assert moved == [robot, chair] and chair.location.x == 2.0
    assert copy.location.x == 3.0 and copy.name == "Chair, trial 1.001"


def test_the_next_trial_takes_the_place_of_the_one_before(scene, tmp_path):
    study = tmp_path / "a.trials"
    assert move_poses(scene, study, "trial 1", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "Chair") == []
    for trial, way in (("trial 1", show_poses), ("trial 2", show_poses), ("trial 3", move_poses)):
        robot, chair = way(scene, study, trial, (0.0, 0.0, 0.0), (1.0, 0.5, 180.0), "Chair")
        assert sorted(one.name for one in bpy.data.objects) == [f"Chair, {trial}", f"Robot, {trial}"]
    assert len(bpy.data.curves) == 2
    assert tuple(chair.location) == (1.0, 0.5, 0.0) and tuple(robot.location) == (0.0, 0.0, 0.0)
