from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.model_camera import add_camera, model_camera
from r2sego_blender.robot.model.mount import parse_mount

XML = """
<mujoco>
  <worldbody>
    <body name="head" pos="1 2 3" euler="0 0 30">
      <freejoint/>
      <geom size="0.1"/>
      <camera name="eye" pos="0.1 0 0" xyaxes="0 -1 0 0 0 1" fovy="60"/>
      <camera name="flat" projection="orthographic" fovy="2"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def simulation():
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_the_camera_stands_where_its_body_has_taken_it(simulation):
    camera = model_camera(*simulation, "eye", 640, 480)
    forward = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    np.testing.assert_allclose(camera.centre, [1, 2, 3] + 0.1 * forward, atol=1e-12)
    np.testing.assert_allclose(camera.forward, forward, atol=1e-12)
    pixels, depth = camera.project((camera.centre + 2 * forward + [0, 0, 2 * np.tan(np.pi / 6)])[None])
    np.testing.assert_allclose(pixels, [[320.0, 0.0]], atol=1e-9)  # the upper border: half of 60 degrees up
    np.testing.assert_allclose(depth, [2.0])


def test_what_cannot_be_a_pinhole_is_told(simulation):
    with pytest.raises(RobotError, match=r"no camera 'nose'.*It has: eye, flat"):
        model_camera(*simulation, "nose", 640, 480)
    with pytest.raises(RobotError, match="'flat' has no perspective"):
        model_camera(*simulation, "flat", 640, 480)


SENSOR = 'sensorsize="0.0064 0.0036" focal="0.004 0.004" principal="0.0005 -0.0002"'


def robot_with_camera(tmp_path, lens: str) -> RobotModel:
    text = re.sub(r'(<camera name="head_camera"[^>]*?) fovy="[^"]*"', rf"\1 {lens}", humanoid_mjcf())
    assert lens in text
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return RobotModel.load(path)


@pytest.mark.parametrize("lens", ['fovy="50"', SENSOR])
@pytest.mark.parametrize("size_px", [(640, 480), (640, 360), (300, 300)])
def test_a_robot_s_eye_is_the_camera_of_its_file(tmp_path, lens, size_px):
    """Rollouts and simulated cameras see the same: pose, focal lengths and principal point."""
    robot = robot_with_camera(tmp_path, lens)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.rest_qpos
    mujoco.mj_forward(robot.model, data)
    simulated, eye = model_camera(robot.model, data, "head_camera", *size_px), robot.camera(*size_px)
    np.testing.assert_allclose(eye.matrix, simulated.matrix, rtol=1e-12)
    np.testing.assert_allclose(eye.world_from_camera, simulated.world_from_camera, atol=1e-9)
    pitched = replace(robot, mount=robot.mount.pitched(30.0)).camera(*size_px)
    np.testing.assert_array_equal(pitched.matrix, eye.matrix)


def test_a_sensor_s_lens_is_carried_to_the_rollouts(tmp_path):
    eye = robot_with_camera(tmp_path, SENSOR).camera(640, 480)
    by_hand = (400.0, 480.0 * 4.0 / 3.6, 270.0, 240.0 + 480.0 * 0.2 / 3.6)
    assert (eye.fx, eye.fy, eye.cx, eye.cy) == pytest.approx(by_hand, rel=1e-6)


def test_a_robot_s_eye_has_perspective(tmp_path):
    with pytest.raises(RobotError, match=r"robot\.xml: the camera 'head_camera' has no perspective\. Give"):
        robot_with_camera(tmp_path, 'fovy="2" projection="orthographic"')


@pytest.mark.parametrize("mode", ["track", "trackcom", "targetbody", "targetbodycom"])
def test_a_camera_that_watches_the_robot_is_no_eye(tmp_path, mode):
    target = ' target="left_ankle_roll_link"' if mode.startswith("target") else ""
    watching = f'<camera name="watching" mode="{mode}"{target} pos="-2 0 1"/><freejoint'
    both = humanoid_mjcf().replace("<freejoint", watching, 1)
    path = tmp_path / "robot.xml"
    path.write_text(both)
    assert RobotModel.load(path).mount.parent == RobotModel.load().mount.parent
    with pytest.raises(RobotError, match=r"'watching' watches the robot and is no eye. It has: head_camera"):
        RobotModel.load(path, "watching")
    path.write_text(re.sub(r'<camera name="head_camera"[^>]*/>', "", both))
    with pytest.raises(RobotError, match="does not say which camera is its eye"):
        RobotModel.load(path)


@pytest.mark.parametrize("height_m", [None, np.nan])
def test_a_camera_that_stands_nowhere_sees_no_black_room(simulation, height_m):
    """Bodies that were not placed yet have a rotation of zeros; of an unstable simulation they have NaN."""
    data = mujoco.MjData(simulation[0])
    if height_m is not None:
        data.qpos[2] = height_m
        mujoco.mj_kinematics(simulation[0], data)
        mujoco.mj_camlight(simulation[0], data)
    with pytest.raises(RobotError, match=r"'eye' stands nowhere yet, .* Call mujoco\.mj_forward"):
        model_camera(simulation[0], data, "eye", 640, 480)


def test_a_declared_mount_is_put_on_its_body():
    spec = mujoco.MjSpec.from_string(XML)
    mount = ["head", [0.06, 0.02, 0.43], [0.1, 0.83, -0.2], {"hfov_deg": 69}]
    add_camera(spec, "mounted", mount, (320, 200))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = model_camera(model, data, "mounted", 320, 200)
    head = np.eye(4)
    head[:3, :3], head[:3, 3] = data.body("head").xmat.reshape(3, 3), data.body("head").xpos
    declared = parse_mount(mount, "here")
    np.testing.assert_allclose(found.world_from_camera, head @ declared.parent_from_camera, atol=1e-12)
    assert found.fx == pytest.approx(declared.camera(320, 200).fx)
    with pytest.raises(RobotError, match=r"no body 'nose'.*It has: head"):
        add_camera(spec, "lost", ["nose", *mount[1:]])
    for word in ("eye", "eye2"):  # of any length, four letters too
        with refused(RobotError, "the mount of 'lost'", "is not four values"):
            add_camera(spec, "lost", word)
