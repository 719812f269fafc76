"""Robots of any file: structure, the mount's conventions, clear errors."""

from __future__ import annotations

import math
import re

import mujoco
import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from legged_robots import quadruped_mjcf
from scipy.spatial import ConvexHull

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.model.collision_shapes import colliding, lowest_m
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.mount import parse_mount
from r2sego_blender.robot.model.structure import posed

PUBLISHED_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]


def published_camera_in_torso() -> np.ndarray:
    """The mount written out by hand, OpenCV axes as columns."""
    sin, cos = math.sin(0.8307767), math.cos(0.8307767)
    pose = np.eye(4)
    pose[:3, 0] = (0.0, -1.0, 0.0)
    pose[:3, 1] = (-sin, 0.0, -cos)
    pose[:3, 2] = (cos, 0.0, -sin)
    pose[:3, 3] = (0.0576235, 0.01753, 0.42987)
    return pose


def test_embedded_mount_is_the_published_one(humanoid):
    assert humanoid.mount.parent == "torso_link"
    np.testing.assert_allclose(humanoid.mount.parent_from_camera, published_camera_in_torso(), atol=1e-6)
    by_hand = parse_mount(PUBLISHED_MOUNT, "test")
    np.testing.assert_allclose(by_hand.parent_from_camera, published_camera_in_torso(), atol=1e-12)


def test_the_robots_eye_is_where_mujoco_has_it(humanoid):
    data = mujoco.MjData(humanoid.model)
    data.qpos[:] = humanoid.rest_qpos
    mujoco.mj_kinematics(humanoid.model, data)
    mujoco.mj_camlight(humanoid.model, data)
    assert humanoid.eye_height_m == pytest.approx(data.cam("head_camera").xpos[2], abs=1e-9)


def test_camera_stands_in_the_world_as_opencv(humanoid):
    camera = humanoid.camera(640, 480)
    pelvis_to_torso = np.array([-0.0039635, 0.0, 0.785 + 0.035 + 0.019])
    np.testing.assert_allclose(camera.centre, pelvis_to_torso + PUBLISHED_MOUNT[1], atol=1e-5)
    ahead_on_floor = camera.centre + camera.forward * camera.centre[2] / -camera.forward[2]
    assert ahead_on_floor[0] > 0.5
    assert ahead_on_floor[2] == pytest.approx(0.0, abs=1e-9)
    pixel, depth = camera.project(ahead_on_floor)
    np.testing.assert_allclose(pixel, (320.0, 240.0), atol=1e-6)
    assert depth > 1.0
    higher, left = camera.project(ahead_on_floor + np.array([[0.0, 0.0, 0.1], [0.0, 0.1, 0.0]]))[0]
    assert higher[1] < 240.0
    assert left[0] < 320.0


def test_field_of_view_is_69_degrees_across_the_vga_image(humanoid):
    expected = 320.0 / math.tan(math.radians(34.5))
    assert humanoid.camera(640, 480).fx == pytest.approx(expected, rel=1e-6)
    assert parse_mount(PUBLISHED_MOUNT, "test").camera(640, 480).fx == pytest.approx(expected, rel=1e-12)


@settings(deadline=None)
@given(st.floats(-30.0, 89.0))
def test_pitched_mount_looks_that_far_down_and_keeps_its_place(down_deg):
    mount = parse_mount(PUBLISHED_MOUNT, "test").pitched(down_deg)
    assert mount.pitch_down_deg == pytest.approx(down_deg, abs=1e-6)
    np.testing.assert_allclose(mount.parent_from_camera[:3, 0], (0.0, -1.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(mount.parent_from_camera[:3, 3], PUBLISHED_MOUNT[1])


def test_camera_follows_the_base_rigidly(humanoid):
    turned = humanoid.rest_qpos.copy()
    turned[:3] += (1.0, 2.0, 0.0)
    turned[3:7] = (math.cos(0.5), 0.0, 0.0, math.sin(0.5))
    rest, moved = humanoid.camera_poses(np.stack([humanoid.rest_qpos, turned]))
    motion = np.eye(4)
    motion[:2, :2] = [[math.cos(1.0), -math.sin(1.0)], [math.sin(1.0), math.cos(1.0)]]
    motion[:2, 3] = (1.0, 2.0)
    np.testing.assert_allclose(moved, motion @ rest, atol=1e-12)


def names(robot: RobotModel, joints) -> list[str]:
    return [robot.model.joint(joint).name for joint in joints]


def test_structure_of_the_embedded_humanoid(humanoid):
    assert names(humanoid, [humanoid.waist_yaw, humanoid.waist_pitch]) == ["waist_yaw_joint", "waist_pitch_joint"]
    assert names(humanoid, humanoid.shoulders) == ["left_shoulder_pitch_joint", "right_shoulder_pitch_joint"]
    left, right = humanoid.legs
    assert [len(left.joints), len(right.joints)] == [6, 6]
    assert humanoid.model.body(left.foot).name == "left_ankle_roll_link"
    assert humanoid.rest_height_m == pytest.approx(0.785, abs=1e-5)
    assert left.sole_m == pytest.approx(0.035, abs=1e-5)
    assert 0.2 < humanoid.radius_m < 0.4
    assert humanoid.servos()["left_knee_joint"].stiffness == 150.0


def test_real_g1_loads_with_the_mount(humanoid, shared_robot):
    path = shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml")
    robot = RobotModel.load(path, PUBLISHED_MOUNT)
    assert robot.model.nu == 29
    posture = humanoid.rest_qpos[None]
    np.testing.assert_allclose(robot.camera_poses(posture), humanoid.camera_poses(posture), atol=2e-4)
    assert robot.servos()["waist_yaw_joint"].stiffness == pytest.approx(200.0, rel=0.01)
    with pytest.raises(RobotError, match=r"does not say which camera.*robot\.mount="):
        RobotModel.load(path)


@pytest.mark.parametrize("file", ["h1/h1/h1.xml", "h1/h1/urdf/h1.urdf"])
def test_h1_loads_from_mjcf_and_urdf(shared_robot, file):
    mount = ["pelvis", [0.10848, 0.0325, 0.69317], [0.0, 0.8, 0.0], {"hfov_deg": 69.0}]
    robot = RobotModel.load(shared_robot(file), mount)
    assert [len(leg.joints) for leg in robot.legs] == [5, 5]
    assert robot.waist_yaw is None
    assert robot.rest_height_m == pytest.approx(1.04, abs=0.02)
    assert robot.camera(640, 480).centre[2] == pytest.approx(robot.rest_height_m + 0.69317, abs=1e-6)


def test_h1_s_arms_and_torso_are_no_legs(shared_robot):
    robot = RobotModel.load(shared_robot("h1/h1/urdf/h1.urdf"), ["torso_link", [0, 0, 0.7], [0, 0, 0], 60])
    assert [robot.model.body(leg.foot).name for leg in robot.legs] == ["left_ankle_link", "right_ankle_link"]
    assert [leg.is_flat for leg in robot.legs] == [True, True]


def test_legs_of_a_quadruped(quadruped):
    feet = [quadruped.model.body(leg.foot).name for leg in quadruped.legs]
    assert feet == ["front_left_calf", "front_right_calf", "rear_left_calf", "rear_right_calf"]
    assert [leg.group for leg in quadruped.legs] == [0, 1, 1, 0]
    assert [len(leg.joints) for leg in quadruped.legs] == [3, 3, 3, 3]
    assert not any(leg.is_flat for leg in quadruped.legs)
    for leg in quadruped.legs:
        assert [quadruped.model.body(body).name[-4:] for body in leg.foot_bodies] == ["calf", "foot"]
        np.testing.assert_allclose(leg.tip, (0.0, 0.0, -0.22), atol=1e-9)  # the middle of the foot's ball
        assert leg.sole_m == pytest.approx(0.022)


def test_legs_of_a_hexapod_go_on_tripods(hexapod):
    sides = [hexapod.model.body(leg.foot).name.removesuffix("_tibia") for leg in hexapod.legs]
    assert sides == ["front_left", "front_right", "middle_left", "middle_right", "rear_left", "rear_right"]
    assert [leg.group for leg in hexapod.legs] == [0, 1, 1, 0, 0, 1]
    np.testing.assert_allclose([leg.tip for leg in hexapod.legs], np.tile([0.16, 0.0, 0.0], (6, 1)), atol=1e-9)


@pytest.mark.parametrize("name", ["humanoid", "quadruped", "hexapod", "wheeled"])
def test_resting_robot_stands_on_all_its_feet(name, request):
    robot = request.getfixturevalue(name)
    model, data = robot.model, posed(robot.model, robot.rest_qpos)
    np.testing.assert_array_equal(robot.rest_qpos[[0, 1, 3, 4, 5, 6]], (0, 0, 1, 0, 0, 0))
    geoms = colliding(model)
    assert lowest_m(model, data, geoms) == pytest.approx(0.0, abs=1e-6)
    for leg in robot.legs:
        assert leg.tip_place(data)[2] == pytest.approx(leg.sole_m, abs=1e-4)
    above = geoms[~np.isin(model.geom_bodyid[geoms], robot.ground_bodies)]
    assert lowest_m(model, data, above) > 0.02
    limited = model.jnt_limited.astype(bool)
    angles = robot.rest_qpos[model.jnt_qposadr[limited]]
    assert (angles >= model.jnt_range[limited, 0]).all()
    assert (angles <= model.jnt_range[limited, 1]).all()
    # The middle of the mass is over the feet or wheels, with room to sway.
    mujoco.mj_comPos(model, data)
    points = [leg.tip_place(data)[:2] for leg in robot.legs] or [(0.15, 0), (-0.15, 0), (0, 0.17), (0, -0.17)]
    if len(points) > 2:
        edges = ConvexHull(points).equations  # the distance to an edge, negative inside
        assert (edges[:, :2] @ data.subtree_com[robot.base, :2] + edges[:, 2] < -0.05).all()


@pytest.mark.parametrize("name", ["humanoid", "quadruped", "hexapod"])
def test_resting_legs_are_bent(name, request):
    """Every foot can be raised and lowered: the legs' inverse kinematics is not singular."""
    robot = request.getfixturevalue(name)
    data = posed(robot.model, robot.rest_qpos)
    mujoco.mj_comPos(robot.model, data)
    for leg in robot.legs:
        jacobian = np.zeros((3, robot.model.nv))
        mujoco.mj_jac(robot.model, data, jacobian, None, leg.tip_place(data), leg.foot)
        own = jacobian[:, robot.model.jnt_dofadr[list(leg.joints)]]
        assert np.linalg.svd(own)[1][-1] > 0.04 * robot.leg_m


@pytest.mark.parametrize("ankle_ahead_m", [0.0, 0.025])
def test_biped_without_a_keyframe_bends_its_knees_ahead(tmp_path, ankle_ahead_m):
    """Straight at zero, or with knees pressed through, as some robots' zero postures have them."""
    text = re.sub(r"<keyframe>.*</keyframe>", "", humanoid_mjcf(), flags=re.DOTALL)
    text = text.replace('pos="0.0 -9.4445e-05 -0.30001"', f'pos="{ankle_ahead_m} 0 -0.30001"')
    text = text.replace('pos="0.0 9.4445e-05 -0.30001"', f'pos="{ankle_ahead_m} 0 -0.30001"')
    robot = RobotModel.load(write(tmp_path, text))
    knees = [robot.model.joint(f"{side}_knee_joint").qposadr[0] for side in ("left", "right")]
    assert (robot.rest_qpos[knees] > 0.2).all()
    data = posed(robot.model, robot.rest_qpos)
    for leg in robot.legs:
        assert data.xmat[leg.foot].reshape(3, 3)[2, 2] > 1.0 - 1e-6
        assert data.xanchor[leg.joints[3], 0] > leg.tip_place(data)[0]


def test_soles_reach_as_far_as_their_shapes_less_a_margin(humanoid):
    for leg in humanoid.legs:
        np.testing.assert_allclose(leg.sole_low_m, (-0.0245, -0.021), atol=0.01)
        np.testing.assert_allclose(leg.sole_high_m, (0.0945, 0.021), atol=0.01)
        assert leg.sole_low_m[0] > -0.05
        assert leg.sole_high_m[0] < 0.12


def test_keyframe_is_the_resting_posture(tmp_path):
    key = '<keyframe><key qpos="1 2 0.3 1 0 0 0  0 0.9 -1.8 0 0.9 -1.8 0 0.9 -1.8 0 0.9 -1.8"/></keyframe>'
    text = quadruped_mjcf().replace("</mujoco>", f"{key}</mujoco>")
    robot = RobotModel.load(write(tmp_path, text))
    np.testing.assert_allclose(robot.rest_qpos[7:], [0.0, 0.9, -1.8] * 4)
    assert robot.rest_height_m == pytest.approx(0.44 * math.cos(0.9) + 0.022, abs=1e-6)


def test_casters_are_no_wheels_and_an_arm_is_no_leg(tmp_path):
    wheel = (
        '<body name="{n}" pos="{x} {y} 0"><joint name="{n}" axis="0 {a} 0"/>'
        '<geom type="cylinder" size="0.1 0.02" zaxis="0 1 0"/></body>'
    )
    wheels = "".join(
        wheel.format(n=n, x=x, y=y, a=a)
        for n, x, y, a in (("left", 0, 0.2, 1), ("right", 0, -0.2, -1), ("caster", 0.2, 0, 1))
    )
    arm = "<body pos='0 0 {z}'><joint axis='0 1 0'/><geom size='0.03'/>{inner}</body>"
    arms = "".join(
        f'<body pos="0 {y} 0.3"><geom size="0.02"/>'
        f"{arm.format(z=0, inner=arm.format(z=-0.1, inner=arm.format(z=-0.1, inner='')))}</body>"
        for y in (0.1, -0.1)
    )
    drives = '<actuator><motor joint="left"/><motor joint="right"/></actuator>'
    text = (
        f'<mujoco><worldbody><body name="base"><freejoint/><geom type="box" size=".2 .1 .05"/>'
        f'<camera name="eye"/>{wheels}{arms}</body></worldbody>{drives}</mujoco>'
    )
    robot = RobotModel.load(write(tmp_path, text))
    assert names(robot, [wheel.joint for wheel in robot.wheels]) == ["left", "right"]
    assert [wheel.forward for wheel in robot.wheels] == [1.0, -1.0]
    assert [wheel.radius_m for wheel in robot.wheels] == pytest.approx([0.1, 0.1], rel=0.01)
    assert robot.legs == ()
    assert "caster" in {robot.model.body(body).name for body in robot.ground_bodies}


def test_wheels_of_a_urdf_without_actuators(tmp_path):
    """As ROS writes differential drives: continuous joints about a turned frame's z axis."""
    inertia = '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><mass value="1"/>{inertia}</inertial>'
    text = (
        f'<robot name="r"><link name="footprint"/><link name="body">{inertial}<collision><origin '
        'xyz="0 0 .1"/><geometry><box size=".2 .2 .1"/></geometry></collision></link><joint name="fixed" '
        'type="fixed"><parent link="footprint"/><child link="body"/><origin xyz="0 0 .033"/></joint>'
    )
    for side, y in (("left", 0.1), ("right", -0.1)):
        text += (
            f'<link name="{side}">{inertial}<collision><geometry><cylinder length=".02" radius=".033"/>'
            f'</geometry></collision></link><joint name="{side}" type="continuous"><parent link="body"/>'
            f'<child link="{side}"/><origin xyz="0 {y} 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>'
        )
    path = tmp_path / "robot.urdf"
    path.write_text(f"{text}</robot>")
    robot = RobotModel.load(path, ["body", [0, 0, 0.2], [0, 0.3, 0], 60])
    assert names(robot, [wheel.joint for wheel in robot.wheels]) == ["left", "right"]
    np.testing.assert_allclose([wheel.offset_m for wheel in robot.wheels], [[0, 0.1], [0, -0.1]], atol=1e-6)
    assert [wheel.forward for wheel in robot.wheels] == [1.0, 1.0]


def write(tmp_path, text: str) -> str:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return str(path)


def test_file_that_does_not_compile_says_what_mujoco_says(tmp_path):
    path = write(tmp_path, '<mujoco><worldbody><body><geom typ="box"/></body></worldbody></mujoco>')
    with pytest.raises(RobotError, match=r"robot\.xml: the robot does not compile: .*typ.* Correct"):
        RobotModel.load(path)
    path = write(tmp_path, "<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>")
    with pytest.raises(RobotError, match="mass and inertia"):
        RobotModel.load(path)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('<body><geom size="1"/></body>', "0 free bodies"),
        ('<body name="a"><freejoint/><geom size="1"/><camera name="eye"/></body>', "0 legs and 0 driven wheels"),
        ('<body><freejoint/><geom size="1"/><camera name="l"/><camera name="r"/></body>', "which camera"),
    ],
)
def test_robot_without_the_needed_parts(tmp_path, body, says):
    with pytest.raises(RobotError, match=says):
        RobotModel.load(write(tmp_path, f"<mujoco><worldbody>{body}</worldbody></mujoco>"))


ENDLESS = '<joint name="{side}" axis="{axis}"{limits}/><geom {shape} mass="1"/>'


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"shape": 'type="box" size=".1 .03 .1"'}, "not round about"),
        ({"axis": "1 0 0"}, "axis does not lie across"),
        ({"z": ".2"}, "above the lowest shape"),
        ({"limits": ' range="-90 90"'}, "range is limited"),
        ({"shape": 'size=".1" contype="0" conaffinity="0"'}, "no collision shape"),
        ({}, ""),
    ],
)
def test_what_keeps_a_wheel_from_being_one_is_told(tmp_path, changes, says):
    """Wheels whose hulls are boxes, above all: as many exported meshes are simplified."""
    given = {"shape": 'type="cylinder" size=".1 .03" euler="90 0 0"', "axis": "0 1 0", "z": "0", "limits": ""} | changes
    wheels = "".join(
        f'<body pos="0 {y} {given["z"]}">{ENDLESS.format(side=f"{side}_wheel", **given)}</body>'
        for side, y in (("left", 0.2), ("right", -0.2))
    )
    text = f"""<mujoco><worldbody><body name="base"><freejoint/><geom size=".1" mass="5"/>
        <camera name="eye" pos="0 0 .5"/>{wheels}</body></worldbody></mujoco>"""
    if not says:
        assert len(RobotModel.load(write(tmp_path, text)).wheels) == 2
        return
    with pytest.raises(RobotError, match=f"0 driven wheels; 'left_wheel' is no wheel: .*{says}.*'right_wheel'"):
        RobotModel.load(write(tmp_path, text))


@pytest.mark.parametrize("limits", ['limited="false"', 'limited="true" range="0 0.6"'])
def test_a_ball_joint_is_refused(tmp_path, limits):
    """Its four coordinates are no angles, and a servo that took one for an angle would tumble it."""
    lamp = f'<body><joint name="neck" type="ball" {limits}/><geom size=".03" mass=".2"/></body>'
    text = humanoid_mjcf().replace('<body name="left_hip_pitch_link"', f'{lamp}<body name="left_hip_pitch_link"')
    with pytest.raises(RobotError, match=r"robot\.xml: 'neck' is a ball joint.* Replace it by three hinges"):
        RobotModel.load(write(tmp_path, text))


@pytest.mark.parametrize("unit_m", [0.001, 0.01])
@pytest.mark.parametrize("camera", ['<camera name="eye"/>', ""])
def test_a_robot_in_another_unit_is_asked_for_its_unit_before_anything_else(tmp_path, unit_m, camera):
    body = f'<body><freejoint/><geom type="box" size="{0.4 / unit_m} {0.4 / unit_m} 1"/>{camera}</body>'
    with refused(RobotError, "robot.xml", "large", cure="millimetres"):
        RobotModel.load(write(tmp_path, f"<mujoco><worldbody>{body}</worldbody></mujoco>"))


def test_a_folder_in_place_of_a_robot_s_file_is_called_one(tmp_path):
    with refused(RobotError, tmp_path, "folder"):
        RobotModel.load(tmp_path)


def test_missing_file_and_unknown_names():
    with pytest.raises(RobotError, match="no such robot file"):
        RobotModel.load("nowhere.xml")
    with pytest.raises(RobotError, match=r"no camera 'eye'\. It has: head_camera"):
        RobotModel.load(mount="eye")
    with pytest.raises(RobotError, match=r"no body 'head'\. It has: pelvis"):
        RobotModel.load(mount=["head", [0, 0, 0], [0, 0, 0], 60])


def test_a_mount_is_a_row_or_a_table_and_its_rpy_turns_a_camera_that_looks_ahead():
    row = parse_mount(["head", [0.1, 0.2, 0.3], [0.2, 0.4, -0.7], {"hfov_deg": 69}], "here")
    table = {"parent": "head", "xyz": [0.1, 0.2, 0.3], "rpy": [0.2, 0.4, -0.7], "hfov_deg": 69}
    named = parse_mount(table, "here")
    assert (
        (named.parent, named.fov_deg, named.vertical)
        == ("head", 69.0, False)
        == (row.parent, row.fov_deg, row.vertical)
    )
    np.testing.assert_array_equal(named.parent_from_camera, row.parent_from_camera)
    np.testing.assert_array_equal(row.parent_from_camera[:, 3], [0.1, 0.2, 0.3, 1.0])
    cr, sr, cp, sp, cy, sy = (f(angle) for angle in (0.2, 0.4, -0.7) for f in (math.cos, math.sin))
    x = [cy * cp, sy * cp, -sp]  # URDF: roll, then pitch, then yaw about fixed axes
    y = [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr]
    z = [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr]
    right, down, ahead = row.parent_from_camera[:3, :3].T
    np.testing.assert_allclose([ahead, -right, -down], [x, y, z], atol=1e-12)
    assert parse_mount(["head", [0, 0, 0], [0, 0, 0], 60], "here").vertical


@pytest.mark.parametrize(
    ("mount", "says"),
    [
        (["torso_link", [0, 0], [0, 0, 0], 60], "xyz"),
        (["torso_link", [0, 0, 0], [0, float("nan"), 0], 60], "rpy"),
        (["torso_link", [0, 0, 0], [0, 47.6, 0], 60], "rpy is 47.6, more than a turn. Write radians"),
        (["torso_link", [0, 0, 0], [0, 0, 0], 500], "fovy_deg"),
        (["torso_link", [0, 0, 0], [0, 0, 0], {"fov": 60}], "field of view"),
        ({"parent": "torso_link", "xyz": [0, 0, 0], "rpy": [0, 0, 0], "hfov": 60}, "'hfov'"),
        (["torso_link"], "four values"),
    ],
)
def test_malformed_mount_names_its_field(mount, says):
    with pytest.raises(RobotError, match=says):
        RobotModel.load(mount=mount)
