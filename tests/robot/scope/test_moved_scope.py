"""A scope's places go along with the world."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.robot.scope.moved_scope import moved_scope
from r2sego_blender.robot.scope.scope import BehaviourScope
from r2sego_blender.robot.scope.scope_file import changed_scope

HERE = Path("scope.toml")
REGION = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]]


@pytest.fixture
def similarity():
    similarity = np.eye(4)
    similarity[:3, :3] = 2.0 * Rotation.from_euler("z", 90, degrees=True).as_matrix()
    similarity[:3, 3] = 0.5, -0.25, 0.1
    return similarity


def test_region_and_target_are_moved(similarity):
    scope = BehaviourScope.load("sit_down")
    scope = changed_scope(scope, {"region.within": REGION, "sit_on.target": [1.0, 0.5]}, HERE)
    moved = moved_scope(scope, similarity, HERE)
    np.testing.assert_allclose(moved.region.within[1], [0.5, 3.75], atol=1e-12)
    np.testing.assert_allclose(moved.sit_on.target, [-0.5, 1.75], atol=1e-12)
    back = moved_scope(moved, np.linalg.inv(similarity), HERE)
    np.testing.assert_allclose(back.region.within, REGION, atol=1e-12)
    assert back.walk_to == scope.walk_to and back.behaviours == scope.behaviours


def test_a_scope_without_places_stays_the_same(similarity):
    scope = BehaviourScope.load("sit_down")
    assert moved_scope(scope, similarity, HERE) is scope
