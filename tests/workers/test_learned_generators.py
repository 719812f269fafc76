"""The door to generator programs, and ViewCrafter behind it, with programs that answer as they would.

ViewCrafter cannot run here. A stand-in environment and repository have its published names; all
else is real: another process, request, conditions, frames and manifest.
"""

import ast
import json
import os
import re
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.config.presets import with_overrides
from r2sego_blender.core.errors import GenerationError, MachineError, NativeError
from r2sego_blender.generation.generators.registry import installation_of
from r2sego_blender.workers import viewcrafter, viewcrafter_program
from r2sego_blender.workers.child import RUNNING, kill_children
from r2sego_blender.workers.engine import engine_environment
from r2sego_blender.workers.external_environment import PROTOCOL
from r2sego_blender.workers.generator_program import (
    COMMAND_VARIABLE,
    SIZE_VARIABLE,
    GeneratorProgram,
    _words,
    named_command,
    named_size,
)
from r2sego_blender.workers.processes import birth

KILLED = r"ended with exit status \d+" if os.name == "nt" else "was killed by signal 9"
WHOLE = {"protocol": PROTOCOL, "backend": "Stand-in 1", "frames": 2}
TELL = """
import json, os, pathlib, subprocess, sys, time
folder = pathlib.Path(sys.argv[1])
def tell(folder=folder, **result):
    (folder / "result.tmp").write_text(json.dumps(result))
    (folder / "result.tmp").replace(folder / "result.json")
"""
WAITING = """
loaded = 0
while True:
    loaded += 1
    tell(folder, protocol=1, backend=f"clip {loaded} of {os.getpid()}", frames=2, waits=True)
    line = sys.stdin.readline()
    if not line:
        break
    folder = pathlib.Path(line.strip())
"""


def program_of(tmp_path: Path, body: str, **options) -> GeneratorProgram:
    script = tmp_path / "generator.py"
    script.write_text(TELL + body)
    return GeneratorProgram([sys.executable, str(script)], "generator.py", "Mend it.", **options)


def folder_of(tmp_path: Path, name: str = "clip") -> Path:
    (tmp_path / name).mkdir()
    return tmp_path / name


def wait_until(true, limit_s: float = 60.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def test_an_answer_is_what_the_program_left(tmp_path):
    with program_of(tmp_path, f"tell(**{WHOLE})") as program:
        assert program.answer(folder_of(tmp_path)) == WHOLE
        assert not RUNNING


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python knows no PYTHONSAFEPATH")
def test_a_program_finds_its_modules_where_the_add_on_started_the_engine(tmp_path, monkeypatch):
    for name, value in engine_environment().items():
        monkeypatch.setenv(name, value)
    (tmp_path / "model_of_ours.py").write_text("NAME = 'Stand-in 1'\n")
    body = "import model_of_ours\ntell(protocol=1, backend=model_of_ours.NAME, frames=2)"
    with program_of(tmp_path, body) as program:
        assert program.answer(folder_of(tmp_path)) == WHOLE


def test_a_program_that_waits_is_started_once(tmp_path):
    with program_of(tmp_path, WAITING) as program:
        first = program.answer(folder_of(tmp_path, "a"))["backend"]
        second = program.answer(folder_of(tmp_path, "b"))["backend"]
        number = int(first.split()[-1])
        assert (first, second) == (f"clip 1 of {number}", f"clip 2 of {number}")
        os.kill(number, signal.SIGTERM)  # Windows has no other
        wait_until(lambda: not birth(number))
        third = program.answer(folder_of(tmp_path, "c"))["backend"]
        assert third.startswith("clip 1 of ")
        number = int(third.split()[-1])
    assert not birth(number)


@pytest.mark.parametrize(
    ("body", "kind", "said"),
    [
        ("print('out of memory'); sys.exit(1)", NativeError,
         r"^generator\.py: the generator ended with exit status 1\. Mend it\. Its last words: out of m"),
        (f"tell(**{WHOLE}); sys.exit(3)", NativeError, r"ended with exit status 3"),
        ("os.kill(os.getpid(), 9)", NativeError, rf"{KILLED}\. Mend it\."),
        ("", NativeError, r"left no result\.json that can be read\. Mend it\."),
        ("(folder / 'result.json').write_text('{')", NativeError, r"left no result\.json that can be read"),
        ("(folder / 'result.json').write_text('[]')", NativeError, r"left no result\.json that can be read"),
        ("tell(protocol=1, frames=2)", NativeError, r"the result\.json of the generator lacks backend"),
        ("tell(protocol=7, backend='x', frames=2)", NativeError, r"follows protocol 7\. This R2S-EGO"),
        ("tell(protocol=1, error='no weights', cure='Fetch them.')", MachineError,
         r"^generator\.py: no weights\. Fetch them\.$"),
        ("tell(protocol=1, error='no GPU'); sys.exit(1)", MachineError, r"no GPU\. Mend it\.$"),
        ("tell(protocol=1, refused='nothing to see')", GenerationError,
         r"^generator\.py: the generator refused, nothing to see\.$"),
        ("time.sleep(60)", NativeError, r"had no answer after 1 s"),
    ],
)  # fmt: skip
def test_what_goes_wrong_is_told_in_a_line(tmp_path, body, kind, said):
    with program_of(tmp_path, body, limit_s=1.0) as program:
        with pytest.raises(kind, match=said) as caught:
            program.answer(folder_of(tmp_path))
        assert type(caught.value) is kind and "\n" not in str(caught.value)
        assert not RUNNING


def test_a_program_that_waits_reads_any_folder_in_a_system_of_few_letters(tmp_path, monkeypatch):
    for name, value in {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}.items():
        monkeypatch.setenv(name, value)
    with program_of(tmp_path, WAITING) as program:
        program.answer(folder_of(tmp_path, "a"))
        assert program.answer(folder_of(tmp_path, "Größe 部屋"))["backend"].startswith("clip 2 of ")


def test_a_program_that_refused_still_waits(tmp_path):
    body = "tell(protocol=1, refused='too dark', waits=True)\nfolder = pathlib.Path(input())\n" + WAITING
    with program_of(tmp_path, body) as program:
        with pytest.raises(GenerationError, match="too dark"):
            program.answer(folder_of(tmp_path, "a"))
        assert len(RUNNING) == 1
        assert program.answer(folder_of(tmp_path, "b"))["backend"].startswith("clip 1 of ")


def test_cancelling_kills_the_program_and_what_it_started(tmp_path):
    body = """
inner = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
(folder / "inner").write_text(str(inner.pid))
inner.wait()
"""
    folder = folder_of(tmp_path)
    errors = []
    with program_of(tmp_path, body) as program:

        def ask():
            try:
                program.answer(folder)
            except NativeError as error:
                errors.append(str(error))

        thread = threading.Thread(target=ask)
        thread.start()
        wait_until(lambda: (folder / "inner").is_file() and (folder / "inner").read_text())
        outer, inner = next(iter(RUNNING)).pid, int((folder / "inner").read_text())
        assert birth(outer) and birth(inner)
        began_s = time.monotonic()
        kill_children()
        thread.join(2.0)
        wait_until(lambda: not birth(outer) and not birth(inner), 10.0)
        assert time.monotonic() - began_s < 10.0  # two seconds on a free machine
    assert len(errors) == 1 and re.search(KILLED, errors[0])


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no such signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_cancelled_command_leaves_no_generator_behind(tmp_path, number):
    folder = folder_of(tmp_path)
    script = tmp_path / "generator.py"
    script.write_text(TELL + "(folder / 'began').write_text(str(os.getpid()))\ntime.sleep(60)\n")
    command = f"""
from pathlib import Path
from r2sego_blender.workers.cancelling import cancel_at_once
from r2sego_blender.workers.generator_program import GeneratorProgram
cancel_at_once()
with GeneratorProgram([{sys.executable!r}, {str(script)!r}], "my", "") as program:
    program.answer(Path({str(folder)!r}))
"""
    engine = subprocess.Popen([sys.executable, "-c", command], stderr=subprocess.PIPE)
    wait_until(lambda: (folder / "began").is_file() and (folder / "began").read_text(), 60.0)
    generator = int((folder / "began").read_text())
    assert birth(generator)
    engine.send_signal(number)
    _, said = engine.communicate(timeout=30.0)
    assert engine.returncode == 128 + number and b"cancelled" in said
    wait_until(lambda: not birth(generator), 10.0)


def test_a_program_that_cannot_be_started_is_named(tmp_path):
    with pytest.raises(MachineError, match=r"my: the generator could not be started: .*\. Mend it\."):
        GeneratorProgram([str(tmp_path / "none")], "my", "Mend it.").answer(folder_of(tmp_path))


def test_a_command_is_read_as_its_system_writes_it():
    told = r'"C:\Program Files\Python\python.exe" C:\gen\run.py --fast'
    assert _words(told, "nt") == [r"C:\Program Files\Python\python.exe", r"C:\gen\run.py", "--fast"]
    assert _words(r"'/opt/my gen/run' a\ b", "posix") == ["/opt/my gen/run", "a b"]


def test_the_environment_names_program_and_size(tmp_path, monkeypatch):
    monkeypatch.delenv(COMMAND_VARIABLE, raising=False)
    monkeypatch.delenv(SIZE_VARIABLE, raising=False)
    with pytest.raises(MachineError, match=r"no generator is named\. Set R2SEGO_GENERATOR"):
        named_command()
    assert named_size() is None
    monkeypatch.setenv(COMMAND_VARIABLE, f"'{sys.executable}' 'my generator.py' --fast")
    assert named_command() == [sys.executable, "my generator.py", "--fast"]
    alone = tmp_path / "my generator"
    alone.write_text("#!/bin/sh\n")
    alone.chmod(alone.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv(COMMAND_VARIABLE, str(alone))
    assert named_command() == [str(alone)]
    monkeypatch.setenv(COMMAND_VARIABLE, f"{sys.executable} -c '{'pass;' * 100}'")
    assert named_command() == [sys.executable, "-c", "pass;" * 100]
    monkeypatch.setenv(COMMAND_VARIABLE, "no-such-program here")
    with pytest.raises(MachineError, match="no-such-program: the program in R2SEGO_GENERATOR is not there"):
        named_command()
    monkeypatch.setenv(COMMAND_VARIABLE, "'half")
    with pytest.raises(MachineError, match="is no command"):
        named_command()
    monkeypatch.setenv(SIZE_VARIABLE, "1024x576")
    assert named_size() == (1024, 576)
    for wrong in ("1024", "0x576", "ax3", "-4x5"):
        monkeypatch.setenv(SIZE_VARIABLE, wrong)
        with pytest.raises(MachineError, match="R2SEGO_GENERATOR_SIZE is no size"):
            named_size()


# ---- ViewCrafter

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
        params = {
            "image_size": [height // 8, width // 8],
            "unet_config": {"params": {"use_checkpoint": True}},
        }
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


def request_of(folder: Path, width: int, height: int, frames: int = 25) -> tuple[Path, np.ndarray]:
    """A clip's request, and its conditions (25, H, W, 3) uint8 with a black gap."""
    pixels = np.random.default_rng(0).integers(1, 255, (25, 9, 16, 3), np.uint8)
    pixels = pixels.repeat(height // 9 + 1, axis=1)[:, :height].repeat(width // 16, axis=2)
    pixels[1:, : height // 3, : width // 4] = 0
    (folder / "conditions").mkdir(parents=True)
    for index, image in enumerate(pixels):
        Image.fromarray(image).save(folder / "conditions" / f"{index:03d}_points.png", compress_level=1)
    request = {"protocol": PROTOCOL, "seed": 7, "frames": frames, "width": width, "height": height}
    (folder / "request.json").write_text(json.dumps(request))
    return folder, pixels


def viewcrafter_program_of() -> GeneratorProgram:
    return GeneratorProgram(viewcrafter.viewcrafter_command(25), "ViewCrafter", viewcrafter.CURE)


def test_viewcrafter_gets_its_values_and_its_model_stays(tmp_path, repository):
    sizes = viewcrafter.SIZES.values()
    assert sorted(sizes) == sorted(viewcrafter_program._CONFIGURATIONS)
    processes = []
    with viewcrafter_program_of() as program:
        for index, (width, height) in enumerate(sizes):
            folder, given = request_of(tmp_path / f"clip{index}", width, height)
            told = program.answer(folder)
            assert told["backend"] == f"ViewCrafter model.ckpt {width}x{height}"
            assert told["frames"] == 25
            expected = np.where(given == 0, 255, given)
            for frame in (0, 24):
                with Image.open(folder / "frames" / f"{frame:03d}.png") as image:
                    np.testing.assert_array_equal(np.asarray(image), expected[frame])
            processes.append({process.pid for process in RUNNING})
    assert len(processes[0]) == 1 and processes[0] == processes[1]
    assert not RUNNING


def test_viewcrafter_that_is_not_there_says_what_to_do(repository, monkeypatch):
    with pytest.raises(
        MachineError, match=r"makes clips of 25 frames, not of 7\. Use --set generation\.clip"
    ):
        viewcrafter.viewcrafter_command(7)
    weights = repository / "checkpoints" / "model.ckpt"
    other = weights.rename(weights.with_name("model_sparse.ckpt"))
    with pytest.raises(MachineError, match=r"model\.ckpt: the weights of ViewCrafter are not there"):
        viewcrafter.viewcrafter_command(25)
    monkeypatch.setenv(viewcrafter.CHECKPOINT_VARIABLE, str(other))
    assert viewcrafter.viewcrafter_command(25)[-1] == str(other)
    (repository / "utils" / "diffusion_utils.py").unlink()
    with pytest.raises(MachineError, match=r"names no folder with utils/diffusion_utils\.py"):
        viewcrafter.viewcrafter_command(25)
    monkeypatch.setenv(viewcrafter.PYTHON_VARIABLE, "")
    with pytest.raises(MachineError, match=r"ViewCrafter is not set up on this machine") as caught:
        viewcrafter.viewcrafter_command(25)
    assert "--set generation.generator=blending" in caught.value.cure


def test_viewcrafter_that_breaks_is_an_error_in_a_line(tmp_path, repository):
    torch = tmp_path / "packages" / "torch.py"
    folder, _ = request_of(tmp_path / "no-gpu", 512, 320)
    torch.write_text(TORCH.replace("GPU", "False"))
    with viewcrafter_program_of() as program, pytest.raises(MachineError, match="needs an NVIDIA GPU"):
        program.answer(folder)
    folder, _ = request_of(tmp_path / "no-torch", 512, 320)
    torch.write_text("raise ImportError('no torch')")
    with viewcrafter_program_of() as program, pytest.raises(MachineError, match="not complete: no torch"):
        program.answer(folder)
    torch.write_text(TORCH.replace("GPU", "True"))
    folder, _ = request_of(tmp_path / "wrong-size", 640, 480)
    with viewcrafter_program_of() as program, pytest.raises(MachineError, match="no frames of 640x480"):
        program.answer(folder)
    folder, _ = request_of(tmp_path / "short", 512, 320, frames=24)
    with viewcrafter_program_of() as program, pytest.raises(MachineError, match="25 frames, not of 24"):
        program.answer(folder)
    utils = repository / "utils" / "diffusion_utils.py"
    utils.write_text(
        DIFFUSION_UTILS.replace("    filled =", "    raise RuntimeError('out of memory')\n    #")
    )
    folder, _ = request_of(tmp_path / "memory", 512, 320)
    with viewcrafter_program_of() as program, pytest.raises(
        NativeError, match=r"ended with exit status 1\. .* Its last words: RuntimeError: out of memory$"
    ):  # fmt: skip
        program.answer(folder)


def test_what_runs_in_viewcrafters_python_is_python_39_and_stands_alone():
    tree = ast.parse(Path(viewcrafter_program.__file__).read_text(), feature_version=(3, 9))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not any(node.level for node in imports)
    assert viewcrafter_program.PROTOCOL == PROTOCOL


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
