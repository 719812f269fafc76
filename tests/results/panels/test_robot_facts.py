from __future__ import annotations

import pytest

from r2sego_blender.results.panels.robot_facts import RobotFacts
from r2sego_blender.robot.scope.scope import BehaviourScope

_BODY = {"joints": 29, "legs": 2, "wheels": 0, "height_m": 1.31, "mass_kg": 35.1}
_USUAL = {"height_m": 1.27, "pitch_deg": 47.6, "fov_deg": 55.0, "fov_is_vertical": True}


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        ({}, "1.27 m high, 48° down, 55° high"),
        ({"left_deg": 0.0, "rolled_deg": 0.1, "fov_is_vertical": False}, "1.27 m high, 48° down, 55° wide"),
        ({"pitch_deg": -20.0}, "1.27 m high, 20° up, 55° high"),
        ({"left_deg": -30.0, "rolled_deg": 171.9}, "1.27 m high, 48° down, 30° right, 172° rolled, 55° high"),
        ({"left_deg": 12.0}, "1.27 m high, 48° down, 12° left, 55° high"),
        ({"height_m": -4.91}, "4.91 m under the floor, 48° down, 55° high"),
    ],
)
def test_the_camera_is_told_as_it_sits_and_looks(camera: dict[str, float], says: str) -> None:
    facts = RobotFacts(BehaviourScope.load("walk_and_look"), {**_BODY, "camera": {**_USUAL, **camera}})
    assert dict(facts.lines())["Camera"] == says
