"""The doors to SAM 3, SAM 3D Objects and NKSR, with environments that answer as those would.

None of the models can run here. A stand-in environment has packages of their names, versions and
published interfaces; everything else is real: another interpreter, request, response, digests.
"""

import ast
import os
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.workers import nksr, sam3, sam3d
from r2sego_blender.workers.models import loading
from r2sego_blender.workers.models.loading import files_digest, state_digest

TORCH = """
import contextlib
import numpy
uint8 = "uint8"
def device(name): return name
def from_numpy(array): return array.view(Tensor)
class Tensor(numpy.ndarray):
    def view(self, kind): return super().view(kind)
    def to(self, device): assert device == "cuda:0"; return self
    def detach(self): return self
    def contiguous(self): return self
    def float(self): return self.astype("float32").view(Tensor)
    def cpu(self): return self
    def numpy(self): return numpy.asarray(self)
class cuda:
    @staticmethod
    def is_available(): return GPU
bfloat16 = "bfloat16"
inference_mode = contextlib.nullcontext
def autocast(device, dtype): return contextlib.nullcontext()
"""
SAM3_BUILDER = """
import numpy
import torch
class Model:
    def state_dict(self):
        return {name: numpy.full(shape, 0.5).view(torch.Tensor) for name, shape in (("b", 2), ("a", ()))}
def build_sam3_image_model(): return Model()
"""
NKSR = """
__version__ = "1.0.3"
import types
import numpy
import torch
class Reconstructor:
    def __init__(self, device):
        assert device == "cuda:0"
        self.network = types.SimpleNamespace(state_dict=lambda: {"a": numpy.ones(3, "float32").view(torch.Tensor)})
    def reconstruct(self, points, normals, voxel_size):
        assert points.dtype == normals.dtype == numpy.float32 and points.shape == normals.shape and voxel_size == 0.02
        self.v = points
        return self
    def extract_dual_mesh(self, mise_iter):
        assert mise_iter == 1
        self.f = numpy.array([[0, 1, 2], [0, 2, LAST]]).view(torch.Tensor)
        return self
"""
SAM3_PROCESSOR = """
import numpy
import torch
COLOURS = {"chair": 0, "table": 1}
class Sam3Processor:
    def __init__(self, model, resolution=1008, device="cuda", confidence_threshold=0.5):
        assert set(model.state_dict()) == {"a", "b"}
        self.least = confidence_threshold
    def set_image(self, image, state=None):
        return {"pixels": numpy.asarray(image)}
    def set_text_prompt(self, prompt, state):
        pixels = state["pixels"]
        masks, scores = [], []
        if prompt in COLOURS:
            whole = pixels[..., COLOURS[prompt]] > 200
            for half in (slice(None, pixels.shape[1] // 2), slice(pixels.shape[1] // 2, None)):
                mask = numpy.zeros_like(whole)
                mask[:, half] = whole[:, half]
                if mask.any():
                    masks.append(mask[None])
                    scores.append(0.9)
        shape = (len(masks), 1, *pixels.shape[:2])
        state["masks"] = numpy.array(masks, bool).reshape(shape).view(torch.Tensor)
        state["scores"] = numpy.array(scores).view(torch.Tensor)
        return state
"""
INFERENCE = """
import os
import numpy
import trimesh
os.environ["CUDA_HOME"] = os.environ["CONDA_PREFIX"]
class Inference:
    def __init__(self, config_file, compile=False):
        assert open(config_file).read() == "the pipeline"
    def __call__(self, image, mask, seed=None):
        assert image.shape[:2] == mask.shape and image.shape[2] == 3 and mask.dtype == bool
        if not mask[0, 0]:
            return {"gs": None, "glb": None}
        return {"glb": trimesh.creation.box((1, 2, float(mask.sum())))}
"""


class Environment:
    """An interpreter that finds stand-in packages first, and keeps no bytecode of them.

    Bytecode is known by its source's second and size: another stand-in of the same size, written
    within that second, would not be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.python = folder, folder / "python"
        self.python.write_text(f'#!/bin/sh\nPYTHONPATH="{folder}:$PYTHONPATH" exec "{sys.executable}" -B "$@"\n')
        self.python.chmod(self.python.stat().st_mode | stat.S_IXUSR)

    def has(self, **modules: str) -> None:
        for name, text in modules.items():
            path = self.folder.joinpath(*name.split("__")).with_suffix(".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def installed(self, package: str, version: str) -> None:
        place = self.folder / f"{package}-{version}.dist-info"
        place.mkdir()
        (place / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")


@pytest.fixture
def environment(tmp_path) -> Environment:
    if os.name == "nt":
        pytest.skip("a shell script stands for the environment")
    (tmp_path / "environment").mkdir()
    return Environment(tmp_path / "environment")


@pytest.fixture
def with_sam3(environment, monkeypatch) -> Environment:
    environment.has(
        torch=TORCH.replace("GPU", "True"),
        sam3____init__="",
        sam3__model____init__="",
        sam3__model_builder=SAM3_BUILDER,
        sam3__model__sam3_image_processor=SAM3_PROCESSOR,
    )
    environment.installed("sam3", "0.1.0")
    monkeypatch.setenv(sam3.PYTHON_VARIABLE, str(environment.python))
    return environment


@pytest.fixture
def with_sam3d(environment, monkeypatch, tmp_path) -> Path:
    repository = tmp_path / "sam-3d-objects"
    for name, text in {"notebook/inference.py": INFERENCE, "checkpoints/hf/pipeline.yaml": "the pipeline"}.items():
        (repository / name).parent.mkdir(parents=True, exist_ok=True)
        (repository / name).write_text(text)
    environment.has(torch=TORCH.replace("GPU", "True"))
    environment.installed("sam3d_objects", "0.0.1")
    monkeypatch.setenv(sam3d.PYTHON_VARIABLE, str(environment.python))
    monkeypatch.setenv(sam3d.REPOSITORY_VARIABLE, str(repository))
    return repository


def photograph(colour: int, columns: slice) -> np.ndarray:
    image = np.full((40, 60, 3), 0.2, np.float32)
    image[10:20, columns, colour] = 1.0
    return image


def test_words_become_masks(with_sam3):
    pictures = {"a.jpg": photograph(0, slice(5, 15)), "b.jpg": photograph(1, slice(40, 50))}
    pictures["b.jpg"][30:, 3:20, 0] = 1.0
    backend, found = sam3.segment_externally(pictures, ["chair", "table", "lamp"])
    assert backend == "SAM 3 0.1.0"
    assert [(one.photograph, one.word, one.score) for one in found] == [
        ("a.jpg", "chair", pytest.approx(0.9)),
        ("b.jpg", "chair", pytest.approx(0.9)),
        ("b.jpg", "table", pytest.approx(0.9)),
    ]
    for one in found:
        expected = pictures[one.photograph][..., 0 if one.word == "chair" else 1] > 0.9
        np.testing.assert_array_equal(one.mask, expected)


def test_a_photograph_and_a_mask_become_a_mesh(with_sam3d, tmp_path):
    mask = np.zeros((40, 60), bool)
    mask[:10, :4] = True
    other = ~mask
    picture = photograph(0, slice(0, 4))
    backend, meshes = sam3d.generate_shapes_externally({"chair": (picture, mask), "lamp": (picture, other)}, tmp_path)
    assert backend == "SAM 3D Objects 0.0.1" and set(meshes) == {"chair"}
    np.testing.assert_allclose(sorted(trimesh.load(meshes["chair"], force="mesh").extents), [1, 2, 40])


@pytest.mark.parametrize("python", ["", "/no/such/python", sys.executable])
def test_a_model_that_is_not_there_says_what_to_do(python, with_sam3d, monkeypatch, tmp_path):
    monkeypatch.setenv(sam3.PYTHON_VARIABLE, python)
    monkeypatch.setenv(sam3d.PYTHON_VARIABLE, python)
    with pytest.raises(MachineError, match=r"SAM 3 .*|R2SEGO_SAM3_PYTHON names no file") as caught:
        sam3.segment_externally({"a": photograph(0, slice(3))}, ["chair"])
    assert "--masks FOLDER" in caught.value.cure
    with pytest.raises(MachineError, match=r"SAM 3D Objects .*|R2SEGO_SAM3D_PYTHON names no file") as caught:
        sam3d.generate_shapes_externally({"a": (photograph(0, slice(3)), np.ones((40, 60), bool))}, tmp_path)
    assert "--mesh NAME=FILE" in caught.value.cure


def test_a_repository_or_weights_that_are_not_there_are_named(with_sam3d, monkeypatch, tmp_path):
    pictures = {"a": (photograph(0, slice(3)), np.ones((40, 60), bool))}
    (with_sam3d / "checkpoints/hf/pipeline.yaml").unlink()
    with pytest.raises(MachineError, match=r"pipeline\.yaml: the weights"):
        sam3d.generate_shapes_externally(pictures, tmp_path)
    monkeypatch.setenv(sam3d.REPOSITORY_VARIABLE, str(tmp_path))
    with pytest.raises(MachineError, match=r"names no folder with notebook/inference\.py"):
        sam3d.generate_shapes_externally(pictures, tmp_path)


def test_another_version_is_refused(with_sam3):
    (with_sam3.folder / "sam3-0.1.0.dist-info").rename(with_sam3.folder / "sam3-0.7.2.dist-info")
    metadata = with_sam3.folder / "sam3-0.7.2.dist-info" / "METADATA"
    metadata.write_text(metadata.read_text().replace("0.1.0", "0.7.2"))
    with pytest.raises(MachineError, match=r"version 0\.7\.2, not of 0\.1"):
        sam3.segment_externally({"a": photograph(0, slice(3))}, ["chair"])


def test_without_a_gpu_nothing_is_tried(with_sam3):
    with_sam3.has(torch=TORCH.replace("GPU", "False"))
    with pytest.raises(MachineError, match="needs an NVIDIA GPU"):
        sam3.segment_externally({"a": photograph(0, slice(3))}, ["chair"])


def test_a_model_that_breaks_is_an_error_with_its_last_words(with_sam3):
    with_sam3.has(sam3__model_builder="def build_sam3_image_model(): raise RuntimeError('out of memory')\n")
    with pytest.raises(NativeError, match="out of memory"):
        sam3.segment_externally({"a": photograph(0, slice(3))}, ["chair"])


@pytest.fixture
def with_nksr(environment, monkeypatch) -> Environment:
    environment.has(torch=TORCH.replace("GPU", "True"), nksr=NKSR.replace("LAST", "3"))
    monkeypatch.setenv(nksr.PYTHON_VARIABLE, str(environment.python))
    return environment


def test_points_with_normals_become_a_surface(with_nksr):
    points = np.random.default_rng(0).normal(size=(4, 3))
    vertices, faces = nksr.reconstruct_externally(points, np.ones((4, 3)), 0.02)
    np.testing.assert_array_equal(vertices, points.astype(np.float32))
    np.testing.assert_array_equal(faces, [[0, 1, 2], [0, 2, 3]])
    with_nksr.has(nksr=NKSR.replace("LAST", "4"))
    with pytest.raises(NativeError, match="no indices of 4"):
        nksr.reconstruct_externally(points, np.ones((4, 3)), 0.02)
    with_nksr.has(torch=TORCH.replace("GPU", "False"))
    with pytest.raises(MachineError, match="NKSR needs an NVIDIA GPU"):
        nksr.reconstruct_externally(points, np.ones((4, 3)), 0.02)


def test_what_a_model_has_loaded_has_a_digest():
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    model, other = (torch.nn.Sequential(torch.nn.Linear(3, 2), torch.nn.BatchNorm1d(2)) for _ in range(2))
    digest = state_digest(torch, model)
    assert digest != state_digest(torch, other)
    other.load_state_dict(model.state_dict())
    assert digest == state_digest(torch, other)
    with torch.no_grad():
        other[0].bias[1] += 1e-6
    assert digest != state_digest(torch, other)
    assert len(state_digest(torch, other.bfloat16())) == 64
    parts = [Path(__file__), Path(sam3.__file__)]
    assert files_digest(parts) != files_digest(parts[::-1])


@pytest.mark.parametrize("name", ["loading", "viewcrafter", "nksr"])
def test_what_runs_beside_a_model_is_python_39_and_needs_the_protocol_alone(name):
    tree = ast.parse(Path(loading.__file__).with_name(f"{name}.py").read_text(encoding="utf-8"), feature_version=(3, 9))
    relative = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level}
    assert relative <= {"protocol.serving", "loading"}
