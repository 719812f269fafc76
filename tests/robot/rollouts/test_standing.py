"""The robot stands on a sound floor, at the free place nearest to the origin, and falls without one."""

import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.standing import stand
from r2sego_blender.robot.scope.scope import BehaviourScope

SCOPE = BehaviourScope.load("walk_and_look")


def test_it_stands_where_the_floor_is_free(humanoid, box_room):
    standing = stand(humanoid, SCOPE, box_room(), RolloutSettings())
    assert standing.stands and standing.reason == "" and standing.held_s == pytest.approx(2.0)
    assert standing.offset_m < 0.02
    assert np.linalg.norm(standing.place_m) < 0.06


def test_it_stands_beside_what_is_at_the_origin(humanoid, box_room):
    path = box_room([(0.0, 0.0, 0.3, 0.3, 0.5)])
    standing = stand(humanoid, SCOPE, path, RolloutSettings())
    assert standing.stands and np.linalg.norm(standing.place_m) > 0.3
    floor = free_floor(humanoid, SCOPE, path)
    assert floor.is_free(np.array(standing.place_m))
    free = floor.points(*np.nonzero(floor.free))
    assert np.linalg.norm(standing.place_m) <= np.linalg.norm(free, axis=1).min() + 1e-9


def test_it_does_not_stand_on_a_floor_that_lets_it_sink(humanoid, box_room):
    """A floor that rays and probes meet, too soft to carry."""
    path = box_room([])
    soft = 'solref="0.4 1" solimp="0.01 0.02 0.5"'
    path.write_text(path.read_text().replace('name="floor"', f'name="floor" {soft} priority="1"'))
    standing = stand(humanoid, SCOPE, path, RolloutSettings())
    assert not standing.stands
    assert standing.reason or standing.offset_m > 0.05


def test_a_scene_without_a_floor_is_refused(humanoid, box_room):
    with pytest.raises(RobotError, match="floor"):
        stand(humanoid, SCOPE, box_room([], floor=False), RolloutSettings())
