"""Made-up policies that see and remember: linear in the picture's brightness, the proprioception and the state."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2sego_blender.robot.controllers.seeing_policy import HEAD_PICTURE


def seeing_network(
    path: Path,
    proprio: int,
    by_brightness: tuple[float, ...] = (0.0, 0.0, 1.0, -1.0),
    picture: tuple[int, ...] = HEAD_PICTURE,
) -> Path:
    """Its four actions are ``by_brightness`` times the picture's mean in [0, 1], a little of what is felt, and of its
    one number of memory, the sum of what it saw."""
    from onnx import TensorProto, helper, numpy_helper

    info, floats = helper.make_tensor_value_info, TensorProto.FLOAT
    weight = np.zeros((proprio + 2, 4), np.float32)
    weight[0] = by_brightness
    weight[1 : proprio + 1] = 0.02 * np.random.default_rng(0).normal(size=(proprio, 4))
    weight[-1] = 0.01
    nodes = [
        helper.make_node("Cast", ["rgb"], ["seen"], to=floats),
        helper.make_node("ReduceMean", ["seen"], ["mean"], axes=[1, 2, 3], keepdims=0),
        helper.make_node("Reshape", ["mean", "row"], ["level"]),
        helper.make_node("Div", ["level", "white"], ["brightness"]),
        helper.make_node("Concat", ["brightness", "proprio", "state"], ["all"], axis=1),
        helper.make_node("MatMul", ["all", "weight"], ["action"]),
        helper.make_node("Add", ["state", "brightness"], ["next_state"]),
    ]
    graph = helper.make_graph(
        nodes,
        "sees",
        [
            info("rgb", TensorProto.UINT8, (1, *picture)),
            info("proprio", floats, (1, proprio)),
            info("state", floats, (1, 1)),
        ],
        [info("action", floats, (1, 4)), info("next_state", floats, (1, 1))],
        [
            helper.make_tensor("row", TensorProto.INT64, [2], [1, 1]),
            helper.make_tensor("white", floats, [1], [255.0]),
            numpy_helper.from_array(weight, "weight"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path.write_bytes(model.SerializeToString())
    return path
