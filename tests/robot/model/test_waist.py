"""The waist of a robot's file: which joints it is, and which way they turn."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from r2sego_blender.robot.behaviours.trajectory import RootTrajectory
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.gait import plan_gait
from r2sego_blender.robot.motion.upper_body import upper_body
from r2sego_blender.robot.scope.scope import BehaviourScope, Look


@pytest.mark.parametrize(
    ("link", "turn"),
    [
        ("waist_yaw_link", (1.0, 0.0, 0.0, 0.0)),
        ("waist_yaw_link", (0.0, 1.0, 0.0, 0.0)),
        ("waist_yaw_link", (0.5**0.5, 0.5**0.5, 0.0, 0.0)),
        ("torso_link", (0.0, 1.0, 0.0, 0.0)),
        ("torso_link", (0.5**0.5, 0.5**0.5, 0.0, 0.0)),
    ],
)
def test_the_waist_is_told_by_how_it_turns_the_robot(tmp_path, humanoid, link, turn):
    """Not by the frame of its link, which exporters of CAD programs turn as they please."""
    path = tmp_path / "robot.xml"
    path.write_text(with_turned_frame(link, turn))
    robot = RobotModel.load(path)
    names = [robot.model.joint(joint).name for joint in (robot.waist_yaw, robot.waist_pitch)]
    assert names == ["waist_yaw_joint", "waist_pitch_joint"]
    gaze = Look(waist_yaw_deg=(30.0, 30.0), waist_pitch_deg=(10.0, 10.0))
    scope, still = replace(BehaviourScope.load("walk_and_look"), look=gaze), np.zeros(3)
    root = RootTrajectory("look_around", np.zeros((3, 2)), still, still, np.zeros(2), still, still, still, still)
    poses = [
        body.camera_poses(upper_body(body, root, plan_gait(root, body), scope, np.random.default_rng(0)))
        for body in (robot, humanoid)
    ]
    assert np.degrees(np.arctan2(*poses[0][0, [1, 0], 2])) == pytest.approx(30.0, abs=1e-6)
    assert np.degrees(np.arcsin(-poses[0][0, 2, 2])) == pytest.approx(47.6 + 10.0, abs=0.01)
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-6)


def with_turned_frame(link: str, turn: tuple[float, float, float, float]) -> str:
    """The embedded humanoid with the frame of one link turned, wxyz, and all it holds where it was."""
    root = ElementTree.fromstring(humanoid_mjcf())
    body = next(body for body in root.iter("body") if body.get("name") == link)
    assert body.attrib.pop("axisangle").endswith(" 0.0")
    held = [part for part in body if part.tag != "joint"]
    joint = body.find("joint")
    axis, back = np.zeros(3), np.array(turn) * (1, -1, -1, -1)
    mujoco.mju_rotVecQuat(axis, np.array(joint.get("axis").split(), float), back)
    joint.set("axis", " ".join(map(str, axis)))
    for part in held:
        body.remove(part)
    body.set("quat", " ".join(map(str, turn)))
    frame = ElementTree.SubElement(body, "frame", quat=" ".join(map(str, back)))
    frame.extend(held)
    return ElementTree.tostring(root, encoding="unicode")
