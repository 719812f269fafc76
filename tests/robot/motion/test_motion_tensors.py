"""Tensors are read as torch reads them; what is more than tensors, or more than the file has, is refused."""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.motion.motion_tensors import tensors_of
from r2sego_blender.robot.motion.recorded_motion import read_recording


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.float16, torch.int64, torch.uint8, torch.bool])
def test_what_torch_saved_is_what_is_read(tmp_path, dtype):
    numbers = (100.0 * torch.rand(7, 6, 5)).to(dtype)
    saved = {"qpos": numbers, "root_pos": numbers[1:6, :, 2].T, "dof_pos": numbers[:, ::2, 1:], "fps": 30}
    torch.save(saved | {"rate_hz": torch.tensor(50.0), "joint_pos": numbers[:0]}, tmp_path / "m.motion")
    found = tensors_of(tmp_path / "m.motion")
    again = torch.load(tmp_path / "m.motion", weights_only=True)
    assert set(found) == set(again)
    for name, values in found.items():
        expected = np.asarray(again[name])
        assert values.dtype == expected.dtype and np.array_equal(values, expected)


def test_what_learns_is_read_as_its_numbers(tmp_path):
    torch.save({"qpos": torch.nn.Parameter(torch.ones(3, 9))}, tmp_path / "m.motion")
    assert tensors_of(tmp_path / "m.motion")["qpos"].tolist() == np.ones((3, 9)).tolist()


@pytest.mark.parametrize(
    "values",
    [
        torch.ones(1).expand(10**6, 10**4),
        torch.ones(3, 9).to_sparse(),
        torch.quantize_per_tensor(torch.ones(3, 9), 0.1, 0, torch.qint8),
        torch.ones(3, 9, dtype=torch.bfloat16),
        torch.ones(3, 9, dtype=torch.complex64),
        torch.ones(3, 9, device="meta"),
        np.ones((3, 9)),
        Path("somewhere"),
    ],
    ids=["expanded", "sparse", "quantised", "bfloat16", "complex", "meta", "numpy", "path"],
)
def test_what_is_no_plain_tensor_is_refused(tmp_path, values):
    torch.save({"qpos": values}, tmp_path / "m.motion")
    with pytest.raises(RobotError, match=r"m\.motion"):
        read_recording(tmp_path / "m.motion")


def archive(path: Path, words: bytes, **numbers: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("m/data.pkl", words)
        for name, content in numbers.items():
            made.writestr(f"m/data/{name}", content)
    return path


def tensor(count: int, shape: tuple[int, ...], steps: tuple[int, ...], begin: int = 0) -> bytes:
    """The words of one tensor of ``count`` numbers in "0", as torch writes them."""
    told = io.BytesIO()

    class Words(pickle._Pickler):
        def persistent_id(self, value):
            return ("storage", torch.FloatStorage, "0", "cpu", count) if value is torch else None

    class Tensor:
        def __reduce__(self):
            return torch._utils._rebuild_tensor_v2, (torch, begin, shape, steps, False, None)

    Words(told, 2).dump({"qpos": Tensor()})
    return told.getvalue()


@pytest.mark.parametrize(
    "words",
    [
        tensor(28, (3, 9), (9, 1)),
        tensor(27, (3, 9), (10, 1)),
        tensor(27, (3, 9), (9, -1)),
        tensor(27, (3, -9), (9, 1)),
        tensor(27, (3, 9), (9, 1), 1),
        tensor(27, (3, 9), (9, 1), -1),
        tensor(27, (2**62, 9), (0, 1)),
        tensor(27, (3, 9), (9,)),
        tensor(27, (2**40, 0), (1, 1)) + b"",
        b"\x80\x02cos\nsystem\nX\x02\x00\x00\x00ls\x85R.",
        b"\x80\x02cbuiltins\neval\nX\x01\x00\x00\x001\x85R.",
        b"\x80\x02c__builtin__\ngetattr\n.",
        b"\x80\x02}r\xff\xff\xff\x7f}s.",
        b"\x80\x05\x96\xff\xff\xff\xff\xff\xff\xff\x7f.",
        b"\x80\x02]\x94" + b"(" * 100_000 + b".",
        b"\x80\x02" + b"]" * 100_000 + b"a" * 99_999 + b".",
        b"\x80\x02ccollections\nOrderedDict\n}\x85R.",
        # A tuple in a tuple, a million times: its hash would end the process.
        b"\x80\x04})" + b"\x85" * 900_000 + b"K\x01s.",
        b"\x80\x04}()" + b"\x85" * 900_000 + b"K\x01u.",
        b"\x80\x04()" + b"\x85" * 900_000 + b"K\x01d.",
        b"\x80\x04()" + b"\x85" * 900_000 + b"\x91.",
        b"\x80\x04\x8f()" + b"\x85" * 900_000 + b"\x90.",
        b"\x80\x04ccollections\nOrderedDict\n)R)" + b"\x85" * 900_000 + b"K\x01s.",
        b"",
        b"." * 2_000_000,
    ],
)
def test_descriptions_that_are_none_are_refused(tmp_path, words):
    file = archive(tmp_path / "m.motion", words, **{"0": bytes(4 * 27)})
    with pytest.raises(RobotError, match=r"m\.motion"):
        read_recording(file)


def test_a_description_by_hand_is_read(tmp_path):
    numbers = np.arange(27, dtype="<f4")
    file = archive(tmp_path / "m.motion", tensor(27, (3, 8), (9, 1), 1), **{"0": numbers.tobytes()})
    assert tensors_of(file)["qpos"].tolist() == numbers.reshape(3, 9)[:, 1:].tolist()
