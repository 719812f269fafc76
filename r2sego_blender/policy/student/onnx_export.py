"""A student as an ONNX file, which runs without torch."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import torch

from ...core.atomic_files import made_whole
from ..packages import policy_package
from .network import Acting, Student
from .targets import PICTURE_SHAPE

INPUTS, OUTPUTS = ("rgb", "proprio", "state"), ("action", "next_state")


def export_onnx(student: Student, file: Path) -> None:
    """Write ``file``: ``rgb``, ``proprio`` and ``state`` in, ``action`` and ``next_state`` out.

    Their shapes are (1, 96, 128, 3) uint8, (1, P), (1, S), (1, 4) and (1, S) float32; the first state is zero. Raises
    MachineError without the extra ``policy``.
    """
    for name in ("onnx", "onnxscript"):
        policy_package(name)
    acting = Acting(student).eval()
    example = (
        torch.zeros((1, *PICTURE_SHAPE), dtype=torch.uint8),
        torch.zeros(1, student.proprio_size),
        student.start(),
    )
    exporter = logging.getLogger("torch.onnx")
    level = exporter.level
    exporter.setLevel(logging.ERROR)
    try:
        with torch.no_grad(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of torch, to its own exporter
            program = torch.onnx.export(
                acting, example, input_names=INPUTS, output_names=OUTPUTS, dynamo=True, verbose=False
            )
    finally:
        exporter.setLevel(level)
    assert program is not None
    with made_whole(file) as unfinished:
        unfinished.write_bytes(program.model_proto.SerializeToString())
