"""Environments that answer as Difix3D+'s and GenFusion's published code would, with what is known beforehand.

Difix3D+ mixes a picture with its reference, half and half. GenFusion shows of each view the directions of its pixels,
red by x / z and green by y / z, and of its camera's place a blue, all from the COLMAP model that it was given.
"""

from __future__ import annotations

from pathlib import Path

from r2sego_blender.workers.models import genfusion

_HUB = """
import os
def hf_hub_download(repository, file, local_files_only=False):
    assert local_files_only and os.environ["HF_HUB_OFFLINE"] == "1"
    assert (repository, file) == ("nvidia/difix_ref", "model_index.json")
    place = os.path.join(os.path.dirname(__file__), "weights.bin")
    if not os.path.exists(place):
        raise FileNotFoundError(repository)
    return place
"""

_TORCH = """
import numpy
uint8 = "uint8"
class Tensor(numpy.ndarray):
    def view(self, kind): return super().view(kind)
    def detach(self): return self
    def contiguous(self): return self
    def cpu(self): return self
    def numpy(self): return numpy.asarray(self)
class cuda:
    @staticmethod
    def is_available(): return GPU
class nn:
    class ModuleList:
        def __init__(self, networks): self.networks = networks
        def state_dict(self): return {name: numpy.full(2, 0.5).view(Tensor) for name in self.networks}
"""

_DIFIX = """
import types
from PIL import Image
class DifixPipeline:
    unet, vae, text_encoder = "unet", "vae", "text_encoder"
    @classmethod
    def from_pretrained(cls, repository, trust_remote_code):
        assert repository == "nvidia/difix_ref" and trust_remote_code
        return cls()
    def set_progress_bar_config(self, disable): assert disable
    def to(self, device): assert device == "cuda"
    def __call__(self, prompt, image, ref_image, num_inference_steps, timesteps, guidance_scale):
        assert prompt == "remove degradation" and image.size == ref_image.size == (1024, 576)
        assert (num_inference_steps, timesteps, guidance_scale) == (1, [199], 0.0)
        return types.SimpleNamespace(images=[Image.blend(image, ref_image, 0.5)])
"""

_TRAIN = """
import argparse, json, os, pathlib
import pycolmap
parser = argparse.ArgumentParser()
for name in OPTIONS: parser.add_argument(name)
for name in ("depth_loss", "mono_depth", "repair"): parser.add_argument("--" + name, action="store_true")
for name in ("data_dir", "diffusion_ckpt", "diffusion_config"): parser.add_argument("--" + name, type=pathlib.Path)
parser.add_argument("-m", type=pathlib.Path)
given = parser.parse_args()
assert given.depth_loss and given.mono_depth and given.repair
assert given.diffusion_ckpt.is_file() and given.diffusion_config.is_file()
model = pycolmap.Reconstruction(str(given.data_dir / "sparse" / "0"))
split = json.loads((given.data_dir / f"train_test_split_{given.sparse_view}.json").read_text())
names = sorted(os.listdir(given.data_dir / "images"))
assert names == sorted(image.name for image in model.images.values())
images = {image.image_id: image.name for image in model.images.values()}
seen = {images[element.image_id] for point in model.points3D.values() for element in point.track.elements}
assert seen == {names[index] for index in split["train_ids"]}  # the reader wants a point of every image
print("Training progress: 1\\rTraining progress: 2")
given.m.mkdir()
(given.m / "told.json").write_text(json.dumps({"split": split, "names": names, "steps": given.iterations}))
"""

_RENDER = """
import argparse, json, pathlib
import numpy as np
import pycolmap
from PIL import Image
parser = argparse.ArgumentParser()
for name in ("--data_dir", "-m"): parser.add_argument(name, type=pathlib.Path)
for name in ("--skip_train", "--skip_mesh"): parser.add_argument(name, action="store_true")
given = parser.parse_args()
assert given.skip_train and given.skip_mesh
told = json.loads((given.m / "told.json").read_text())
model = pycolmap.Reconstruction(str(given.data_dir / "sparse" / "0"))
shown = given.m / "test" / "renders"
shown.mkdir(parents=True)
for image in model.images.values():
    name = image.name
    with Image.open(given.data_dir / "images" / name) as picture:
        assert picture.size == (image.camera.width, image.camera.height)
        assert picture.size[0] >= 960 and picture.size[1] >= 540
        is_black = np.asarray(picture).max() == 0
    if told["names"].index(name) not in told["split"]["test_ids"]:
        assert not is_black
        continue
    assert is_black  # no photograph of a view is ever handed over
    camera = image.camera
    fx, fy, cx, cy = camera.params
    v, u = np.mgrid[:camera.height, :camera.width] + 0.5
    pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
    centre = -pose.rotation.matrix().T @ pose.translation
    colour = np.stack([(u - cx) / fx, (v - cy) / fy, np.full(u.shape, centre @ (0.3, 0.2, 0.1))], axis=-1)
    Image.fromarray(np.rint(np.clip(0.5 + 0.5 * colour, 0.0, 1.0) * 255.0).astype(np.uint8)).save(shown / name)
"""


def write_difix3d(folder: Path, gpu: bool = True) -> Path:
    """Packages to be put before the real ones; ``weights.bin`` stands for the model's."""
    (folder / "pipeline_difix").mkdir(parents=True)
    (folder / "pipeline_difix" / "__init__.py").write_text(_DIFIX)
    (folder / "torch").mkdir()
    (folder / "torch" / "__init__.py").write_text(_TORCH.replace("GPU", str(gpu)))
    (folder / "huggingface_hub").mkdir()
    (folder / "huggingface_hub" / "__init__.py").write_text(_HUB)
    (folder / "huggingface_hub" / "weights.bin").write_bytes(b"weights")
    return folder


def write_genfusion(folder: Path) -> Path:
    """A repository, with its weights where its scripts have them."""
    place = folder / genfusion.FOLDER
    for file in (*genfusion.FILES, genfusion.CHECKPOINT):
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        (place / file).write_text(file)
    (place / "train.py").write_text(f"OPTIONS = {sorted(genfusion.options_of(1, 1))!r}\n{_TRAIN}")
    (place / "render.py").write_text(_RENDER)
    return folder
