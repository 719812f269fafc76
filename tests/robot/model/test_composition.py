"""The composition: a rolling robot's fixed casters slide on the floor, its wheels do not."""

from __future__ import annotations

import mujoco
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.robot.model.model import RobotModel

WHEEL = '<body name="{0}" pos="0 {1} 0"><joint axis="0 1 0"/><geom type="cylinder" size=".1 .02" zaxis="0 1 0"/></body>'


@pytest.mark.parametrize(("words", "friction"), [("", 0.01), ('friction="0.4" priority="2"', 0.4)])
def test_fixed_casters_slide_unless_they_have_a_priority(tmp_path, box_room, words, friction):
    file = tmp_path / "cart.xml"
    file.write_text(
        '<mujoco><worldbody><body name="base" pos="0 0 .1"><freejoint/><camera name="eye"/>'
        f'<geom type="box" size=".2 .1 .02" pos="0 0 .1"/>{WHEEL.format("left", 0.2)}{WHEEL.format("right", -0.2)}'
        f'<body name="caster" pos="-.15 0 -.07"><geom size=".03" {words}/></body></body></worldbody></mujoco>'
    )
    robot = RobotModel.load(str(file))
    made = compose(robot, box_room(()), RolloutSettings())
    data = mujoco.MjData(made.model)
    data.qpos[:7] = (0, 0, 0.0999, 1, 0, 0, 0)
    mujoco.mj_forward(made.model, data)
    touching = {
        made.model.body(made.model.geom_bodyid[geom]).name: contact.friction[0]
        for contact in data.contact
        for geom in contact.geom
        if not made.scene_geoms[geom]
    }
    assert touching == {"robot/caster": friction, "robot/left": 1.0, "robot/right": 1.0}
