"""Policies that see and remember: their numbers through the process and back, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.controllers.seeing_policy import SeeingPolicyFile

onnx = pytest.importorskip("onnx")

PICTURE, PROPRIO, ACTIONS = (6, 8, 3), 2, 3


def write(path: Path, state_size=2, rgb=onnx.TensorProto.UINT8, shape=(1, *PICTURE), proprio="proprio", divide=1.0):
    """Remembers the sum of its proprioception; its action is that, and the picture's mean, over ``divide``."""
    make, floats = onnx.helper.make_tensor_value_info, onnx.TensorProto.FLOAT
    nodes = [
        onnx.helper.make_node("Add", [proprio, "state"], ["next_state"]),
        onnx.helper.make_node("Cast", ["rgb"], ["seen"], to=floats),
        onnx.helper.make_node("ReduceMean", ["seen"], ["mean"], axes=[1, 2, 3], keepdims=0),
        onnx.helper.make_node("Reshape", ["mean", "row"], ["brightness"]),
        onnx.helper.make_node("Concat", ["next_state", "brightness"], ["all"], axis=1),
        onnx.helper.make_node("Div", ["all", "divisor"], ["action"]),
    ]
    graph = onnx.helper.make_graph(
        nodes,
        "sees",
        [make("rgb", rgb, shape), make(proprio, floats, (1, PROPRIO)), make("state", floats, (1, state_size))],
        [make("action", floats, (1, ACTIONS)), make("next_state", floats, (1, state_size))],
        [
            onnx.helper.make_tensor("row", onnx.TensorProto.INT64, [2], [1, 1]),
            onnx.helper.make_tensor("divisor", floats, [1], [divide]),
        ],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return path


def test_it_sees_and_remembers_each_episode_for_itself(tmp_path):
    policy = SeeingPolicyFile(write(tmp_path / "sees.onnx"), PICTURE, PROPRIO, ACTIONS)
    rng = np.random.default_rng(0)
    episodes = [policy.start(), policy.start()]
    felt = np.zeros((2, PROPRIO))
    for turn in (0, 1, 0, 0, 1):
        rgb = rng.integers(0, 256, PICTURE, dtype=np.uint8)
        proprio = rng.normal(size=PROPRIO).astype(np.float32)
        felt[turn] += proprio
        np.testing.assert_allclose(episodes[turn](rgb, proprio), [*felt[turn], rgb.mean()], rtol=1e-5)


@pytest.mark.parametrize(
    "other",
    [
        {"shape": (1, 6, 9, 3)},
        {"rgb": onnx.TensorProto.FLOAT},
        {"proprio": "joints"},
        {"state_size": "n"},
        {"divide": 0.0},
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, other):
    path = write(tmp_path / "other.onnx", **other)
    with pytest.raises(RobotError) as raised:
        SeeingPolicyFile(path, PICTURE, PROPRIO, ACTIONS)
    assert raised.value.where == str(path) and raised.value.cure


def test_other_counts_and_kinds_are_refused(tmp_path):
    path = write(tmp_path / "sees.onnx")
    for sizes in ((PROPRIO + 1, ACTIONS), (PROPRIO, ACTIONS + 1)):
        with pytest.raises(RobotError):
            SeeingPolicyFile(path, PICTURE, *sizes)
    program = tmp_path / "sees.pt"
    program.write_bytes(path.read_bytes())
    with pytest.raises(RobotError):
        SeeingPolicyFile(program, PICTURE, PROPRIO, ACTIONS)


def test_a_state_that_is_no_number_ends_the_episode(tmp_path):
    act = SeeingPolicyFile(write(tmp_path / "sees.onnx"), PICTURE, PROPRIO, ACTIONS).start()
    with pytest.raises(RobotError):
        act(np.zeros(PICTURE, np.uint8), np.array([np.inf, 0.0], np.float32))
