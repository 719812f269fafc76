"""Learned policies: what they observe and drive, where they go, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from policy_controllers import SCOPE, controller, only
from tiny_policies import counting_policy, onnx_policy, torchscript_policy, trusted

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.controllers.controller import check_controller
from r2sego_blender.robot.controllers.policy import PolicyDrive
from r2sego_blender.robot.controllers.policy_layout import PolicyLayout
from r2sego_blender.robot.controllers.policy_observation import Command, Observer
from r2sego_blender.robot.controllers.policy_runtime import PolicyFile
from r2sego_blender.robot.model.collision_shapes import lowest_m
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.attempts import Attempts
from r2sego_blender.robot.rollouts.rollout import Rollout
from r2sego_blender.robot.scope.scope import BehaviourScope, Control, Episode, Failures

KNEES = """
rate_hz = 50.0
step_s = 0.005
joints = [["left_knee_joint", 0.3, 150.0, 4.0], ["right_knee_joint", 0.2, 150.0, 4.0]]
held = [["waist_yaw_joint", 0.1, 200.0, 5.0]]
observation = [{ term = "joint_pos_rel" }, { term = "velocity_command" }]
[action]
joints = ["right_knee_joint", "left_knee_joint"]
scale = [0.5, 0.25]
clip = 1.0
[commands]
vx_m_s = [-0.5, 1.0]
vy_m_s = [-0.3, 0.3]
yaw_rate_rad_s = [-1.0, 1.0]
"""


@pytest.fixture
def knees(tmp_path) -> PolicyLayout:
    (tmp_path / "knees.toml").write_text(KNEES)
    return PolicyLayout.load(tmp_path / "knees.toml")


# What a policy observes


def random_state(robot: RobotModel, rng: np.random.Generator) -> mujoco.MjData:
    data = mujoco.MjData(robot.model)
    data.qpos[:] = rng.normal(size=robot.model.nq)
    data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
    data.qvel[:] = rng.normal(size=robot.model.nv)
    return data


def gravity_in_base(quaternion: np.ndarray) -> np.ndarray:
    """As the published deployment code has it."""
    w, x, y, z = quaternion
    return np.array([2.0 * (-z * x + w * y), -2.0 * (z * y + w * x), 1.0 - 2.0 * (w * w + z * z)])


def addresses(robot: RobotModel, layout: PolicyLayout) -> tuple[np.ndarray, np.ndarray]:
    joints = [robot.model.joint(joint.name).id for joint in layout.joints]
    return robot.model.jnt_qposadr[joints], robot.model.jnt_dofadr[joints]


def test_observations_of_five_steps_per_term_equal_plain_numpy(humanoid):
    layout = PolicyLayout.load("unitree_rl_lab_g1_29dof")
    qpos, dof = addresses(humanoid, layout)
    observer, rng = Observer(layout, qpos, dof), np.random.default_rng(0)
    default = np.array([joint.default_rad for joint in layout.joints])
    steps = []
    for index in range(7):
        data, action = random_state(humanoid, rng), rng.normal(size=29)
        vx, vy, turn = rng.normal(size=3)
        observed = observer.observe(data, Command(vx, vy, turn, True), action, 0.02 * index)
        steps.append(
            [
                0.2 * data.qvel[3:6],
                gravity_in_base(data.qpos[3:7]),
                [vx, vy, turn],
                data.qpos[qpos] - default,
                0.05 * data.qvel[dof],
                action,
            ]
        )
        last = ([steps[0]] * 5 + steps)[-5:]  # the first observation fills the history
        expected = np.concatenate([np.concatenate([step[term] for step in last]) for term in range(6)])
        np.testing.assert_allclose(observed, expected, atol=1e-5)
        assert observed.dtype == np.float32


def test_observations_of_whole_steps_equal_plain_numpy(humanoid):
    layout = PolicyLayout.load("falcon_g1_29dof")
    qpos, dof = addresses(humanoid, layout)
    observer, rng = Observer(layout, qpos, dof), np.random.default_rng(1)
    default = np.array([joint.default_rad for joint in layout.joints])
    history = [np.zeros(115)] * 5
    for index in range(7):
        data, action = random_state(humanoid, rng), rng.normal(size=29)
        vx, vy, turn, height = rng.normal(size=4)
        waist = tuple(rng.normal(size=3))
        command = Command(vx, vy, turn, index % 2 == 0, height, waist)
        observed = observer.observe(data, command, action, 0.02 * index)
        terms = {
            "actions": action,
            "base_ang_vel": 0.25 * data.qvel[3:6],
            "command_ang_vel": [turn],
            "command_base_height": [2.0 * height],
            "command_lin_vel": [vx, vy],
            "command_stand": [float(index % 2 == 0)],
            "command_waist_dofs": waist,
            "dof_pos": data.qpos[qpos] - default,
            "dof_vel": 0.05 * data.qvel[dof],
            "projected_gravity": gravity_in_base(data.qpos[3:7]),
            "ref_upper_dof_pos": np.zeros(14),
        }
        history = [*history[1:], np.concatenate([terms[name] for name in sorted(terms)])]
        np.testing.assert_allclose(observed, np.concatenate(history), atol=1e-5)


def test_the_gait_s_phase_and_the_base_s_velocity(humanoid, tmp_path):
    layout = PolicyLayout.load("unitree_rl_gym_h1")
    only_phase = replace(layout, joints=layout.joints[:0], terms=layout.terms[-1:])
    observer = Observer(only_phase, np.empty(0, int), np.empty(0, int))
    data = random_state(humanoid, np.random.default_rng(2))
    for time_s in (0.0, 0.2, 1.3):
        phase = 2.0 * math.pi * (time_s % 0.8) / 0.8
        seen = observer.observe(data, Command(), np.zeros(0), time_s)
        np.testing.assert_allclose(seen, [math.sin(phase), math.cos(phase)], atol=1e-6)
    (tmp_path / "layout.toml").write_text(KNEES.replace('"joint_pos_rel"', '"base_lin_vel"'))
    layout = PolicyLayout.load(tmp_path / "layout.toml")
    seen = Observer(layout, *addresses(humanoid, layout)).observe(data, Command(), np.zeros(2), 0.0)
    mujoco.mj_forward(humanoid.model, data)
    rotation = data.xmat[humanoid.base].reshape(3, 3)
    np.testing.assert_allclose(rotation @ seen[:3], data.qvel[:3], atol=1e-5)


# Networks


@pytest.mark.parametrize(("write", "name"), [(onnx_policy, "p.onnx"), (torchscript_policy, "p.pt")])
def test_both_kinds_of_network_compute_what_they_say(tmp_path, knees, write, name):
    rng = np.random.default_rng(3)
    weight, bias = rng.normal(size=(5, 2)), rng.normal(size=2)
    network = PolicyFile(trusted(write(tmp_path / name, weight, bias)), knees).network()
    for observation in rng.normal(size=(4, 5)).astype(np.float32):
        np.testing.assert_allclose(network(observation), observation @ weight + bias, atol=1e-5)


def test_a_recurrent_policy_begins_anew(tmp_path, knees):
    file = PolicyFile(trusted(counting_policy(tmp_path / "counting.pt")), knees)
    for _ in range(2):
        network = file.network()
        assert [float(network(np.zeros(5, np.float32))[0]) for _ in range(3)] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("write", [onnx_policy, torchscript_policy])
def test_other_sizes_than_the_layout_s_are_refused(tmp_path, knees, write):
    path = tmp_path / ("p.onnx" if write is onnx_policy else "p.pt")
    with pytest.raises(RobotError, match=r"trained with: observation and history of .*knees.toml"):
        PolicyFile(trusted(write(path, np.zeros((6, 2)), np.zeros(2))), knees)
    with pytest.raises(RobotError, match=r"the network gives 3 actions, the layout 2. Correct joints or action"):
        PolicyFile(trusted(write(path, np.zeros((5, 3)), np.zeros(3))), knees)
    with pytest.raises(RobotError, match=r"the network's actions are not finite"):
        PolicyFile(trusted(write(path, np.zeros((5, 2)), np.full(2, np.nan))), knees)


def test_files_that_are_no_policies_are_refused(tmp_path, knees):
    good = onnx_policy(tmp_path / "good.onnx", np.zeros((5, 2)), np.zeros(2)).read_bytes()
    for name, content, message in (
        ("empty.onnx", b"", "this is no ONNX network"),
        ("noise.onnx", bytes(range(256)), "this is no ONNX network"),
        ("cut.onnx", good[: len(good) // 2], "this is no ONNX network"),
        ("elsewhere.onnx", good + b"\n\x08location\x12\x0b/etc/passwd", "its tensors lie in other files"),
        ("empty.pt", b"", "this is no TorchScript file"),
        ("noise.pt", bytes(range(256)), "this is no TorchScript file"),
        ("policy.pkl", b"", r"'.pkl' is no policy"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RobotError, match=message) as raised:
            PolicyFile(trusted(tmp_path / name), knees)
        assert str(raised.value).startswith(str(tmp_path / name))
    with pytest.raises(RobotError, match="this policy cannot be read"):
        PolicyFile(tmp_path / "missing.onnx", knees)


@pytest.mark.parametrize(
    ("control", "says"),
    [
        ("file = 'gone.onnx'\nlayout = 'knees.toml'", r"gone.onnx: this policy .*controller.file"),
        ("file = 'cut.onnx'\nlayout = 'knees.toml'", r"cut.onnx: this is no ONNX network"),
        ("file = 'cut.onnx'\nlayout = 'gone.toml'", r"gone.toml: .*controller.layout"),
    ],
)
def test_a_scope_is_refused_for_its_policy_before_there_is_a_room(tmp_path, knees, humanoid, control, says):
    (tmp_path / "cut.onnx").write_bytes(b"cut off")
    (tmp_path / "mine.toml").write_text(f"[controller]\nkind = 'policy'\n{control}")
    scope = BehaviourScope.load(tmp_path / "mine.toml")
    with pytest.raises(RobotError, match=says) as raised:
        check_controller(humanoid, scope)
    assert str(raised.value).startswith(str(tmp_path))


def test_a_pickle_is_not_run_as_torchscript(tmp_path, knees):
    import torch

    marker = tmp_path / "ran"

    class Hostile:
        def __reduce__(self):
            return Path.touch, (marker,)

    torch.save(Hostile(), tmp_path / "hostile.pt")
    with pytest.raises(RobotError, match="this is no TorchScript file"):
        PolicyFile(trusted(tmp_path / "hostile.pt"), knees)
    assert not marker.exists()


# Controllers and drives


def test_actions_become_targets(humanoid, box_room, tmp_path, knees):
    bias = np.array([0.4, -7.0])  # for the right knee, then the left, which is clipped
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), bias)
    made = controller(humanoid, box_room(), policy, knees.where)
    drive = made.draw(np.random.default_rng(0))
    model, data = made.composition.model, mujoco.MjData(made.composition.model)
    data.qpos[:] = drive.qpos
    drive.apply(data, 0)
    target = {model.actuator(index).name: value for index, value in enumerate(data.ctrl)}
    assert target.pop("left_knee_joint") == pytest.approx(0.3 + 0.25 * -1.0)
    assert target.pop("right_knee_joint") == pytest.approx(0.2 + 0.5 * 0.4, abs=1e-6)
    assert target.pop("waist_yaw_joint") == 0.1
    for name, angle in target.items():
        joint = humanoid.model.joint(name)
        assert angle == pytest.approx(humanoid.rest_qpos[joint.qposadr[0]])
    assert model.opt.timestep == 0.005
    assert not made.composition.has_wrench
    knee = made.composition.model.actuator("left_knee_joint").id
    assert (made.composition.stiffness[knee], made.composition.damping[knee]) == (150.0, 4.0)
    assert made.name == "policy p.onnx"


def test_targets_are_held_between_actions(humanoid, box_room, tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.ones((5, 2)), np.zeros(2))
    made = controller(humanoid, box_room(), policy, knees.where)
    drive = made.draw(np.random.default_rng(0))
    data = mujoco.MjData(made.composition.model)
    data.qpos[:] = drive.qpos
    seen = []
    for step in range(9):
        data.qpos[7:] += 0.01
        drive.apply(data, step)
        seen.append(data.ctrl.copy())
    assert all(np.array_equal(one, seen[0]) for one in seen[:4])
    assert not np.array_equal(seen[4], seen[3])
    assert all(np.array_equal(one, seen[4]) for one in seen[4:8])
    assert not np.array_equal(seen[8], seen[7])


def test_drives_begin_on_the_floor_and_repeat_with_their_seed(humanoid, box_room, tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    made = controller(humanoid, box_room(), policy, knees.where)
    floor = free_floor(humanoid, SCOPE, box_room())
    behaviours = set()
    for seed in range(12):
        first, again = (made.draw(np.random.default_rng(seed)) for _ in range(2))
        np.testing.assert_array_equal(first.qpos, again.qpos)
        np.testing.assert_array_equal(first.goal, again.goal)
        behaviours.add(first.behaviour)
        assert floor.is_free(np.array([first.qpos[:2], first.goal])).all()
        data = mujoco.MjData(made.composition.model)
        data.qpos[:] = first.qpos
        mujoco.mj_kinematics(made.composition.model, data)
        for leg in humanoid.legs:
            name = "robot/" + humanoid.model.body(leg.foot).name
            assert data.body(name).xpos[2] - leg.sole_m >= -1e-9
    assert behaviours == {"walk_to", "look_around"}


def faulty(path: Path, answer: str) -> Path:
    """A TorchScript policy that gives ``answer`` once it observes anything but zeros."""
    import torch

    module = torch.jit.script(type("Faulty", (torch.nn.Module,), {})())
    module.define(f"""
        def forward(self, x):
            if bool(x.abs().sum() > 0.0):
                {answer}
            return x[:, :2]
    """)
    module.save(str(path))
    return trusted(path)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ("return x[:, :3]", "faulty.pt: the policy gave 2 actions at first, and then 3"),
        ('raise Exception("no encoder")', "faulty.pt: the policy failed while it was driving: .*no encoder"),
        ("return x[:, :2] + x[:, :3]", "faulty.pt: the policy failed while it was driving: .*must match"),
    ],
)
def test_a_policy_that_fails_on_its_way_is_named(humanoid, box_room, tmp_path, knees, answer, says):
    made = controller(humanoid, box_room(), faulty(tmp_path / "faulty.pt", answer), knees.where)
    drive = made.draw(np.random.default_rng(0))
    data = mujoco.MjData(made.composition.model)
    data.qpos[:] = drive.qpos
    data.qpos[7:] += 0.1
    with pytest.raises(RobotError, match=says):
        drive.apply(data, 0)


def test_what_a_policy_prints_is_not_among_a_command_s_results(tmp_path, knees, capfd):
    network = PolicyFile(faulty(tmp_path / "told.pt", 'print("told by the policy")'), knees).network()
    network(np.ones(5, np.float32))
    told = capfd.readouterr()
    assert "told by the policy" not in told.out and "told by the policy" in told.err


def test_no_number_of_a_policy_s_is_an_error_with_the_joint(humanoid, box_room, tmp_path, knees):
    import torch

    class Dividing(torch.nn.Module):
        """0 for an observation of zeros, else 0 and no number."""

        def forward(self, observation: torch.Tensor) -> torch.Tensor:
            worst = observation.abs().sum()
            return torch.stack([worst * 0.0, torch.where(worst > 0.0, worst / 0.0 * 0.0, worst)])[None]

    torch.jit.script(Dividing()).save(str(tmp_path / "dividing.pt"))
    made = controller(humanoid, box_room(), trusted(tmp_path / "dividing.pt"), knees.where)
    drive = made.draw(np.random.default_rng(0))
    data = mujoco.MjData(made.composition.model)
    data.qpos[:] = drive.qpos
    data.qpos[7:] += 0.1
    with pytest.raises(RobotError, match=r"dividing.pt: the policy's action for left_knee_joint is not finite"):
        drive.apply(data, 0)
    data.qpos[:] = np.nan  # a simulation that diverged is no fault of the policy's
    drive.apply(data, 4)
    assert np.isfinite(data.ctrl).all()


def test_what_does_not_fit_the_robot_or_the_policy_is_refused(humanoid, box_room, tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    other = tmp_path / "other.toml"
    for old, field in (("left_knee_joint", "joints"), ("waist_yaw_joint", "held")):
        other.write_text(KNEES.replace(old, "tail_joint"))
        with pytest.raises(RobotError, match=rf"other.toml: {field} name tail_joint, which the robot embedded"):
            controller(humanoid, box_room(), policy, other)
    with pytest.raises(RobotError, match=r"behaviours.sit_on is nothing that .* can be told. Set it to 0"):
        controller(humanoid, box_room(), policy, knees.where, only(SCOPE, sit_on=1.0))
    with pytest.raises(RobotError, match=r"behaviours.squat is nothing"):
        controller(humanoid, box_room(), policy, knees.where, only(SCOPE, squat=1.0))
    with pytest.raises(RobotError, match=r"controller.layout is missing"):
        controller(humanoid, box_room(), policy, "")
    with pytest.raises(RobotError, match=r"controller.file is missing"):
        controller(humanoid, box_room(), "", knees.where)


def rollouts(robot, scene, policy, layout, scope, count) -> list[Rollout]:
    scope = replace(scope, controller=Control(kind="policy", file=str(policy), layout=layout))
    attempts = Attempts(robot.source, robot.mount, scope, free_floor(robot, scope, scene), scene, RolloutSettings(), 5)
    return [attempts.run(number) for number in range(count)]


def test_a_policy_that_is_no_walker_falls_and_the_frame_is_kept(humanoid, box_room, tmp_path):
    layout = tmp_path / "limp.toml"
    layout.write_text(KNEES.replace("150.0, 4.0", "0.0, 0.1"))
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    scope = replace(
        SCOPE, episode=Episode(duration_s=4.0), failures=Failures(penetration_m=0.0, slide_m=0.0, joint_limit_deg=90.0)
    )
    (rollout,) = rollouts(humanoid, box_room(), policy, str(layout), scope, 1)
    assert rollout.reason in {"fall", "body_contact"}
    assert rollout.frame == len(rollout.qpos) - 1 < 20
    assert rollout.detail


def test_a_drive_is_what_the_protocol_asks_for(humanoid, box_room, tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    drive = controller(humanoid, box_room(), policy, knees.where).draw(np.random.default_rng(1))
    assert isinstance(drive, PolicyDrive)
    assert drive.qpos.shape == (humanoid.model.nq,)
    assert drive.goal.shape == (2,)
    assert drive.seat is None
    low, high = SCOPE.look.camera_pitch_deg
    assert low <= drive.mount.pitch_down_deg <= high
    assert drive.duration_s == SCOPE.episode.duration_s


def test_a_policy_s_start_has_point_feet_on_the_floor(quadruped, box_room, tmp_path):
    """A standing posture that is held stands, from the first frame on: the soles, not the knees, are at the floor."""
    model, rest = quadruped.model, quadruped.rest_qpos
    legs = [model.joint(joint) for leg in quadruped.legs for joint in leg.joints]
    rows = ", ".join(f'["{joint.name}", {rest[joint.qposadr[0]]}, 150.0, 4.0]' for joint in legs)
    commands = KNEES[KNEES.index("[commands]") :]
    text = f'rate_hz = 50.0\nstep_s = 0.004\njoints = [{rows}]\nobservation = [{{ term = "projected_gravity" }}]\n'
    (tmp_path / "stands.toml").write_text(f"{text}[action]\nscale = 0.25\n{commands}")
    policy = onnx_policy(tmp_path / "zeros.onnx", np.zeros((3, 12)), np.zeros(12))
    made = controller(quadruped, box_room(), policy, tmp_path / "stands.toml")
    data, own = mujoco.MjData(made.composition.model), made.composition.model
    data.qpos[:] = made.draw(np.random.default_rng(0)).qpos
    mujoco.mj_kinematics(own, data)
    feet = [np.flatnonzero(np.isin(own.geom_bodyid, leg.foot_bodies)) for leg in made.composition.legs]
    assert not any(leg.is_flat for leg in quadruped.legs)
    assert [lowest_m(own, data, geoms) for geoms in feet] == pytest.approx([0.0] * 4, abs=1e-3)
    still = replace(SCOPE.look_around, turn_deg=(0.0, 0.0))
    scope = replace(only(SCOPE, look_around=1.0), look_around=still, episode=Episode(duration_s=1.0))
    tried = rollouts(quadruped, box_room(), policy, str(tmp_path / "stands.toml"), scope, 2)
    assert [rollout.reason for rollout in tried] == ["", ""]
