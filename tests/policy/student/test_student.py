"""The student's network: its state carries what it saw, its ONNX file says the same, and its targets are geometry."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.policy.environment.state import PrivilegedState
from r2sego_blender.policy.student.network import PLACE_M, Acting, Student, fourier_features
from r2sego_blender.policy.student.onnx_export import INPUTS, OUTPUTS, export_onnx
from r2sego_blender.policy.student.targets import PICTURE_SHAPE, seat_target
from r2sego_blender.robot.behaviours.trajectory import Seat
from r2sego_blender.robot.controllers.seeing_policy import SeeingPolicyFile

PROPRIO = 70


@pytest.fixture(scope="module")
def student() -> Student:
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(3)
        made = Student(PROPRIO)
    made.proprio_mean.fill_(0.2)
    made.proprio_deviation.fill_(0.7)
    return made.eval()


def frames(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    rng = np.random.default_rng(seed)
    rgb = rng.integers(0, 256, (1, count, *PICTURE_SHAPE), dtype=np.uint8)
    return torch.from_numpy(rgb), torch.from_numpy(rng.normal(size=(1, count, PROPRIO)).astype(np.float32))


def test_frame_by_frame_it_says_what_it_says_of_the_sequence(student):
    rgb, proprio = frames(9)
    with torch.inference_mode():
        whole = student(rgb, proprio, student.start())
        acting, state = Acting(student), student.start()
        for step in range(9):
            action, state = acting(rgb[:, step], proprio[:, step], state)
            torch.testing.assert_close(action[0, :3], whole.commands[0, step])
            assert bool(action[0, 3] > 0.0) == bool(whole.sit[0, step] > 0.0)
        torch.testing.assert_close(state, whole.state)
        first, second = (student(rgb[:, part], proprio[:, part], student.start()) for part in (slice(4), slice(4, 9)))
        carried = student(rgb[:, 4:], proprio[:, 4:], first.state)
    torch.testing.assert_close(carried.commands, whole.commands[:, 4:])
    assert (carried.commands - second.commands).abs().max() > 1e-4


@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 2), st.floats(-math.pi, math.pi), st.floats(0.1, 3.0), st.floats(-0.03, 0.03)
)
def test_a_place_is_told_finely_and_a_heading_whatever_its_length(place_m, yaw_rad, length, aside_m):
    heading = length * math.cos(yaw_rad), length * math.sin(yaw_rad)
    poses = [(x / PLACE_M, place_m[1] / PLACE_M, *heading) for x in (place_m[0], place_m[0] + aside_m)]
    found = fourier_features(torch.tensor(poses, dtype=torch.float64)).numpy()
    waves = np.outer(2.0 ** np.arange(6) * math.tau / 8.0, place_m).ravel()
    turns = np.outer((1, 2, 4, 8), (yaw_rad,)).ravel()
    wanted = [*np.sin(waves), *np.cos(waves), *np.stack([np.cos(turns), np.sin(turns)], axis=1).ravel()]
    np.testing.assert_allclose(found[0], wanted, atol=1e-9)
    # A centimetre moves them together by a fifth and more: more than what is noise to a network.
    assert np.linalg.norm(found[1] - found[0]) >= 20.0 * abs(aside_m) - 1e-9


def test_onnx_says_what_torch_says_over_a_sequence(student, tmp_path: Path):
    for name in ("onnx", "onnxscript"):
        pytest.importorskip(name, reason="the extra `policy` is not installed")
    import onnxruntime

    file = tmp_path / "student.onnx"
    export_onnx(student, file)
    assert [path.name for path in tmp_path.iterdir()] == ["student.onnx"]
    session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
    inputs = {one.name: (one.shape, one.type) for one in session.get_inputs()}
    size = student.start().shape[1]
    assert inputs == {
        "rgb": ([1, *PICTURE_SHAPE], "tensor(uint8)"),
        "proprio": ([1, PROPRIO], "tensor(float)"),
        "state": ([1, size], "tensor(float)"),
    }
    assert tuple(inputs) == INPUTS
    assert [(one.name, one.shape) for one in session.get_outputs()] == [(OUTPUTS[0], [1, 4]), (OUTPUTS[1], [1, size])]
    rgb, proprio = frames(30, seed=1)
    acting, state, their_state = Acting(student), student.start(), student.start().numpy()
    act = SeeingPolicyFile(file, PICTURE_SHAPE, PROPRIO, 4).start()  # as a stranger's
    with torch.inference_mode():
        for step in range(30):
            given_ = {"rgb": rgb[:, step].numpy(), "proprio": proprio[:, step].numpy(), "state": their_state}
            action, state = acting(rgb[:, step], proprio[:, step], state)
            their_action, their_state = session.run(None, given_)
            np.testing.assert_allclose(their_action, action.numpy(), atol=1e-5, rtol=0.0)
            np.testing.assert_allclose(act(rgb[0, step].numpy(), proprio[0, step].numpy()), their_action[0], atol=1e-6)
            np.testing.assert_allclose(their_state, state.numpy(), atol=1e-5, rtol=0.0)
    assert np.abs(their_action).max() <= 1.0


def test_all_of_it_learns(student):
    """Every weight has a gradient of where it is, commands, sitting and the seat's pose together."""
    learning = Student(PROPRIO)
    rgb, proprio = frames(3)
    output = learning(rgb, proprio, learning.start())
    said = [output.levels.softmax(dim=-1), output.sit, output.seat, learning.localizer(learning.see(rgb[0]))]
    torch.stack([one.square().mean() for one in said]).sum().backward()
    assert all(weights.grad is not None and weights.grad.abs().max() > 0.0 for weights in learning.parameters())
    assert 0.4e6 < sum(weights.numel() for weights in learning.parameters()) < 0.6e6


def state(x: float, y: float, yaw_rad: float, seat: Seat | None, goal: np.ndarray | None = None) -> PrivilegedState:
    return PrivilegedState(np.array([x, y]), yaw_rad, 0.7, seat, goal, False, 0.0, 0.0, 0.0, "")


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7), st.floats(-7, 7), st.floats(-3, 3))
def test_the_seat_s_pose_in_the_base_s_frame_leads_back_to_the_seat(x, y, yaw_rad, seat_yaw_rad, edge_x):
    seat = Seat(edge_m=(edge_x, 0.5), height_m=0.45, yaw_rad=seat_yaw_rad, approach_m=0.3)
    distance_m, *angles, in_view = seat_target(state(x, y, yaw_rad, seat)).tolist()
    bearing, heading = math.atan2(angles[0], angles[1]), math.atan2(angles[2], angles[3])
    back = np.array([x, y]) + distance_m * np.array([math.cos(yaw_rad + bearing), math.sin(yaw_rad + bearing)])
    np.testing.assert_allclose(back, seat.edge_m, atol=1e-5)
    assert abs(math.remainder(yaw_rad + heading - seat_yaw_rad, math.tau)) < 1e-5
    assert not in_view or abs(bearing) < math.pi / 4


def test_a_goal_is_a_target_too_and_nothing_is_none():
    target = seat_target(state(0.0, 0.0, math.pi / 2, None, np.array([0.0, 2.0])))
    np.testing.assert_allclose(target, [2.0, 0.0, 1.0, 0.0, 1.0, 1.0], atol=1e-6)
    assert np.isnan(seat_target(state(0.0, 0.0, 0.0, None))).all()
