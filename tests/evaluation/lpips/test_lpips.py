"""LPIPS-Alex against the same network built of torch's own layers, and its refusals."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from r2sego_blender.evaluation.lpips.weights import WEIGHTS_VARIABLE, find_lpips

HEADS = Path(__file__).resolve().parents[3] / "../shared/weights/lpips_lin_alex_v0.1.pth"
WIDTHS = (64, 192, 384, 256, 256)


def alexnet_features() -> nn.Sequential:
    """The feature layers of AlexNet in torchvision's order, with random weights."""
    torch.manual_seed(5)
    return nn.Sequential(
        nn.Conv2d(3, 64, 11, 4, 2),
        nn.ReLU(),
        nn.MaxPool2d(3, 2),
        nn.Conv2d(64, 192, 5, padding=2),
        nn.ReLU(),
        nn.MaxPool2d(3, 2),
        nn.Conv2d(192, 384, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(384, 256, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(256, 256, 3, padding=1),
        nn.ReLU(),
        nn.MaxPool2d(3, 2),
    )


@pytest.fixture
def weights(tmp_path) -> Path:
    """A folder with a random backbone and random positive heads, named as torchvision names them."""
    features = alexnet_features()
    backbone = {f"features.{name}": value for name, value in features.state_dict().items()}
    backbone["classifier.1.weight"] = torch.zeros(2, 2)
    torch.save(backbone, tmp_path / "alexnet-owt-00000000.pth")
    heads = {f"lin{i}.model.1.weight": torch.rand(1, width, 1, 1) for i, width in enumerate(WIDTHS)}
    torch.save(heads, tmp_path / "lpips_lin_alex_v0.1.pth")
    return tmp_path


def reference_distance(folder: Path, a: np.ndarray, b: np.ndarray) -> float:
    """LPIPS in plain steps, float64, from the paper's formula."""
    features = alexnet_features().double()
    heads = torch.load(folder / "lpips_lin_alex_v0.1.pth", weights_only=True)
    shift = np.array([-0.030, -0.088, -0.188])
    scale = np.array([0.458, 0.448, 0.450])

    def maps(image: np.ndarray) -> list[np.ndarray]:
        values = torch.from_numpy(((image * 2.0 - 1.0) - shift) / scale).permute(2, 0, 1)[None]
        taps = []
        with torch.no_grad():
            for index, layer in enumerate(features):
                values = layer(values)
                if index in (1, 4, 7, 9, 11):
                    taps.append(values[0].numpy())
        return taps

    total = 0.0
    for level, (x, y) in enumerate(zip(maps(a), maps(b), strict=True)):
        x = x / (np.linalg.norm(x, axis=0) + 1e-10)
        y = y / (np.linalg.norm(y, axis=0) + 1e-10)
        head = heads[f"lin{level}.model.1.weight"].double().numpy().reshape(-1, 1, 1)
        total += ((x - y) ** 2 * head).sum(axis=0).mean()
    return float(total)


def test_distance_equals_the_reference(weights):
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 96, 128, 3))
    network, reason = find_lpips(weights)
    assert reason == ""
    assert network.distance(a, b) == pytest.approx(reference_distance(weights, a, b), rel=1e-4)
    assert network.distance(a, b) == pytest.approx(network.distance(b, a), rel=1e-6)
    assert network.distance(a, a) == 0.0


def test_the_folder_is_named_by_the_environment(weights, monkeypatch):
    monkeypatch.setenv(WEIGHTS_VARIABLE, str(weights))
    assert find_lpips()[0] is not None
    monkeypatch.delenv(WEIGHTS_VARIABLE)
    network, reason = find_lpips()
    assert network is None
    assert reason.startswith("AlexNet weights not at hand")


def test_torch_is_loaded_for_weights_alone():
    program = "import sys, r2sego_blender.evaluation.scene_evaluation, r2sego_blender.pipeline\n"
    program += "sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


def test_each_missing_file_is_named(weights):
    (weights / "lpips_lin_alex_v0.1.pth").unlink()
    assert find_lpips(weights)[1].startswith("LPIPS heads not at hand")
    next(weights.glob("alexnet*.pth")).unlink()
    assert find_lpips(weights)[1].startswith("AlexNet weights not at hand")


def test_a_pickle_that_would_run_code_is_refused_and_not_run(weights, tmp_path):
    trap = tmp_path / "ran"

    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(trap),)

    with next(weights.glob("alexnet*.pth")).open("wb") as file:
        pickle.dump(Trap(), file)
    network, reason = find_lpips(weights)
    assert network is None
    assert "cannot be used" in reason
    assert not trap.exists()


@pytest.mark.parametrize("content", [b"", b"garbage", b"PK\x03\x04cut"])
def test_damaged_weights_give_a_reason(weights, content):
    next(weights.glob("alexnet*.pth")).write_bytes(content)
    network, reason = find_lpips(weights)
    assert network is None
    assert "cannot be used" in reason


def test_what_pytorch_raises_on_other_bytes_is_a_reason_too(weights):
    heads = weights / HEADS.name
    whole = heads.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(200):
        changed = bytearray(whole)
        for place in rng.integers(0, min(len(whole), 1000), rng.integers(1, 6)):
            changed[place] = rng.integers(256)
        heads.write_bytes(changed[: rng.integers(1, len(changed) + 1)] if rng.random() < 0.3 else changed)
        network, reason = find_lpips(weights)
        assert (network is None) == ("cannot be used" in reason)


def test_weights_that_are_packed_or_not_finite_are_not_used(weights):
    heads = weights / HEADS.name
    infinite = {f"lin{i}.model.1.weight": torch.full((1, width, 1, 1), torch.inf) for i, width in enumerate(WIDTHS)}
    torch.save(infinite, heads)
    assert "finite" in find_lpips(weights)[1]
    torch.save({"lin0.model.1.weight": torch.zeros(10_000_000)}, weights / "large.pth")
    with zipfile.ZipFile(weights / "large.pth") as large, zipfile.ZipFile(heads, "w", zipfile.ZIP_DEFLATED) as packed:
        for name in large.namelist():
            packed.writestr(name, large.read(name))
    assert "packed" in find_lpips(weights)[1]


@pytest.mark.skipif(not HEADS.is_file(), reason="the LPIPS heads are not in ../shared/weights")
def test_the_published_heads_are_read(weights):
    (weights / HEADS.name).write_bytes(HEADS.read_bytes())
    network, reason = find_lpips(weights)
    assert reason == ""
    assert [tuple(head.shape) for head in network.heads] == [(width, 1, 1) for width in WIDTHS]
    assert all(float(head.min()) >= 0.0 and float(head.max()) > 0.0 for head in network.heads)
