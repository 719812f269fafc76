"""A made-up pair of SONIC's networks: linear maps with the real names and shapes, so that what comes out is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def linear_network(path: Path, weight: np.ndarray, bias: np.ndarray, output: str, source: str = "obs_dict") -> Path:
    """Write ``output`` = ``source`` (1, n) @ ``weight`` (n, m) + ``bias`` (m,)."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    inputs, outputs = weight.shape
    graph = helper.make_graph(
        [helper.make_node("Gemm", [source, "weight", "bias"], [output])],
        "linear",
        [helper.make_tensor_value_info(source, TensorProto.FLOAT, [1, inputs])],
        [helper.make_tensor_value_info(output, TensorProto.FLOAT, [1, outputs])],
        [
            numpy_helper.from_array(weight.astype(np.float32), "weight"),
            numpy_helper.from_array(bias.astype(np.float32), "bias"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def encoder(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """``weight`` (1762, 64)."""
    return linear_network(path, weight, bias, "encoded_tokens")


def decoder(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """``weight`` (994, 29)."""
    return linear_network(path, weight, bias, "action")
