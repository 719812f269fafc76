"""ViewCrafter behind the door to generator programs.

It cannot run here. A stand-in environment and repository have its published names; all else is real:
another process, request, conditions, frames and response.
"""

import hashlib
import json
import os
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.config.presets import with_overrides
from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.generation.generators import viewcrafter
from r2sego_blender.generation.generators.registry import installation_of
from r2sego_blender.workers.child import RUNNING
from r2sego_blender.workers.models import viewcrafter as viewcrafter_program
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker
from r2sego_blender.workers.protocol.request import Request

TORCH = """
import contextlib
import numpy
class Tensor(numpy.ndarray):
    def to(self, device): assert device == "cuda:0"; return self
    def float(self): return self.astype("float32").view(Tensor)
    def cpu(self): return self
    def numpy(self): return numpy.asarray(self)
def from_numpy(array):
    assert array.dtype == numpy.float32 and array.flags.c_contiguous
    return array.view(Tensor)
class cuda:
    @staticmethod
    def is_available(): return GPU
    class amp:
        autocast = contextlib.nullcontext
no_grad = contextlib.nullcontext
"""
OMEGACONF = """
import json
class OmegaConf:
    @staticmethod
    def load(path): return json.load(open(path))
"""
LIGHTNING = """
seeds = []
def seed_everything(seed): seeds.append(seed)
"""
DIFFUSION_UTILS = """
import types
import numpy
import torch
import pytorch_lightning
class Model:
    perframe_ae = training = True
    def to(self, device): assert device == "cuda:0"; return self
    def eval(self): self.training = False
def instantiate_from_config(config):
    assert config["params"]["unet_config"]["params"]["use_checkpoint"] is False
    model = Model()
    model.latents = config["params"]["image_size"]
    model.cond_stage_model = types.SimpleNamespace(device="cpu")
    model.model = types.SimpleNamespace(diffusion_model=types.SimpleNamespace(out_channels=4))
    return model
def load_model_checkpoint(model, ckpt):
    model.weights = open(ckpt).read()
    return model
def image_guided_synthesis(model, prompts, videos, noise_shape, n_samples=1, ddim_steps=50, ddim_eta=1.,
                           unconditional_guidance_scale=1.0, cfg_img=None, fs=None, text_input=False,
                           multiple_cond_cfg=False, timestep_spacing='uniform', guidance_rescale=0.0,
                           condition_index=None, **kwargs):
    # The values that the repository's own command line has as defaults.
    assert (n_samples, ddim_steps, ddim_eta, unconditional_guidance_scale) == (1, 50, 1.0, 7.5)
    assert (cfg_img, fs, text_input, multiple_cond_cfg) == (None, 10, True, False)
    assert (timestep_spacing, guidance_rescale, condition_index) == ("uniform_trailing", 0.7, [0])
    assert prompts == ["Rotating view of a scene"] and not kwargs
    assert model.weights == "weights" and not model.training and model.perframe_ae is True
    assert model.cond_stage_model.device == "cuda:0"
    assert pytorch_lightning.seeds[-1] == 7
    height, width = (8 * side for side in model.latents)
    assert videos.shape == (1, 3, 25, height, width) and videos.min() >= -1 and videos.max() <= 1
    assert list(noise_shape) == [1, 4, 25, *model.latents]
    filled = numpy.where(videos == -1, 2.0, videos)  # gaps become white, beyond the range
    return filled[None].view(torch.Tensor)
"""


@pytest.fixture
def repository(tmp_path, monkeypatch) -> Path:
    """A stand-in repository with weights, and an environment whose python finds stand-in packages."""
    if os.name == "nt":
        pytest.skip("a shell script stands for the environment")
    repository, packages = tmp_path / "ViewCrafter", tmp_path / "packages"

    def configuration(height, width):
        params = {"image_size": [height // 8, width // 8], "unet_config": {"params": {"use_checkpoint": True}}}
        return json.dumps({"model": {"params": params}})

    for path, text in {
        repository / "utils/diffusion_utils.py": DIFFUSION_UTILS,
        repository / "configs/inference_pvd_1024.yaml": configuration(576, 1024),
        repository / "configs/inference_pvd_512.yaml": configuration(320, 512),
        repository / "checkpoints/model.ckpt": "weights",
        packages / "torch.py": TORCH.replace("GPU", "True"),
        packages / "omegaconf.py": OMEGACONF,
        packages / "pytorch_lightning.py": LIGHTNING,
    }.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{packages}" exec "{sys.executable}" "$@"\n')
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv(viewcrafter.PYTHON_VARIABLE, str(python))
    monkeypatch.setenv(viewcrafter.REPOSITORY_VARIABLE, str(repository))
    monkeypatch.delenv(viewcrafter.CHECKPOINT_VARIABLE, raising=False)
    return repository


def request_of(folder: Path, width: int, height: int, frames: int = 25) -> tuple[Request, np.ndarray]:
    """A clip's request, and its conditions (25, H, W, 3) uint8 with a black gap."""
    pixels = np.random.default_rng(0).integers(1, 255, (25, 9, 16, 3), np.uint8)
    pixels = pixels.repeat(height // 9 + 1, axis=1)[:, :height].repeat(width // 16, axis=2)
    pixels[1:, : height // 3, : width // 4] = 0
    files = {f"conditions/{index:03d}_points.png": folder / f"{index:03d}.png" for index in range(25)}
    folder.mkdir()
    for file, image in zip(files.values(), pixels, strict=True):
        Image.fromarray(image).save(file, compress_level=1)
    return Request("clip", "", {"seed": 7, "frames": frames, "width": width, "height": height}, files), pixels


def answered(worker: ProgramWorker, request: Request) -> None:
    with ask(worker, request):
        pass


def command(clip_frames: int = 25) -> tuple[str, ...]:
    return viewcrafter.installation("viewcrafter", GenerationSettings(clip_frames=clip_frames)).command


def viewcrafter_worker() -> ProgramWorker:
    return ProgramWorker(command(), "ViewCrafter", "Mend it.")


def test_viewcrafter_gets_its_values_and_its_model_stays(tmp_path, repository):
    sizes = viewcrafter.SIZES.values()
    assert sorted(sizes) == sorted(viewcrafter_program._CONFIGURATIONS)
    processes = []
    with viewcrafter_worker() as program:
        for index, (width, height) in enumerate(sizes):
            request, given = request_of(tmp_path / f"clip{index}", width, height)
            expected = np.where(given == 0, 255, given)
            with ask(program, request) as response:
                assert response.backend == f"ViewCrafter model.ckpt {width}x{height}"
                assert response.weights == hashlib.sha256(b"weights").hexdigest()
                assert response.values == {"frames": 25}
                for frame in (0, 24):
                    with Image.open(response.file(f"frames/{frame:03d}.png")) as image:
                        np.testing.assert_array_equal(np.asarray(image), expected[frame])
            processes.append({process.pid for process in RUNNING})
    assert len(processes[0]) == 1 and processes[0] == processes[1]
    assert not RUNNING


def test_viewcrafter_that_is_not_there_says_what_to_do(repository, monkeypatch):
    with pytest.raises(MachineError, match=r"makes clips of 25 frames, not of 7\. Use --set generation\.clip"):
        command(7)
    weights = repository / "checkpoints" / "model.ckpt"
    other = weights.rename(weights.with_name("model_sparse.ckpt"))
    with pytest.raises(MachineError, match=r"model\.ckpt: the weights of ViewCrafter are not there"):
        command()
    monkeypatch.setenv(viewcrafter.CHECKPOINT_VARIABLE, str(other))
    assert command()[-1] == str(other)
    (repository / "utils" / "diffusion_utils.py").unlink()
    with pytest.raises(MachineError, match=r"names no folder with utils/diffusion_utils\.py"):
        command()
    monkeypatch.setenv(viewcrafter.PYTHON_VARIABLE, "")
    with pytest.raises(MachineError, match=r"ViewCrafter is not set up on this machine") as caught:
        command()
    assert "--set generation.generator=blending" in caught.value.cure


def test_viewcrafter_that_breaks_is_an_error_in_a_line(tmp_path, repository):
    torch = tmp_path / "packages" / "torch.py"
    request, _ = request_of(tmp_path / "no-gpu", 512, 320)
    torch.write_text(TORCH.replace("GPU", "False"))
    with viewcrafter_worker() as program, pytest.raises(MachineError, match="needs an NVIDIA GPU"):
        answered(program, request)
    request, _ = request_of(tmp_path / "no-torch", 512, 320)
    torch.write_text("raise ImportError('no torch')")
    with viewcrafter_worker() as program, pytest.raises(MachineError, match="not complete: no torch"):
        answered(program, request)
    torch.write_text(TORCH.replace("GPU", "True"))
    request, _ = request_of(tmp_path / "wrong-size", 640, 480)
    with viewcrafter_worker() as program, pytest.raises(MachineError, match="no frames of 640x480"):
        answered(program, request)
    request, _ = request_of(tmp_path / "short", 512, 320, frames=24)
    with viewcrafter_worker() as program, pytest.raises(MachineError, match="25 frames, not of 24"):
        answered(program, request)
    utils = repository / "utils" / "diffusion_utils.py"
    utils.write_text(DIFFUSION_UTILS.replace("    filled =", "    raise RuntimeError('out of memory')\n    #"))
    request, _ = request_of(tmp_path / "memory", 512, 320)
    with (
        viewcrafter_worker() as program,
        pytest.raises(NativeError, match=r"^ViewCrafter: the worker broke: RuntimeError: out of memory\. Mend it\."),
    ):
        answered(program, request)


def test_viewcrafter_is_known_by_its_weights_and_the_code_that_is_run(repository, monkeypatch):
    def identity(name="viewcrafter"):
        return installation_of(with_overrides({"generation.generator": name})).identity

    first = identity()
    assert first == identity("viewcrafter_512")  # the setting says the size
    other = repository.parent / "other.ckpt"
    (repository / "checkpoints" / "model.ckpt").rename(other)
    assert identity() is None
    monkeypatch.setenv(viewcrafter.CHECKPOINT_VARIABLE, str(other))
    assert identity() == first
    other.write_text("other weights")
    assert identity() != first
    other.write_text("weights")
    (repository / "utils" / "diffusion_utils.py").write_text("# of another commit")
    assert identity() not in (first, None)
