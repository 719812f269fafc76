"""Packages with the names, versions and published interfaces of the models, to be put before the real ones.

What each says is known beforehand: Depth Anything 3 and MapAnything tell the depth of one wall by the poses and lenses
they are given, each in its own conventions; the others read it from the pictures' red, inverse depth less 0.1.
"""

from __future__ import annotations

from pathlib import Path

NORMAL, OFFSET = (0.4, 1.0, 0.3), 4.0
"""The wall: world points X with NORMAL @ X = OFFSET."""

_HUB = """
import os
def hf_hub_download(repository, file, local_files_only=False):
    assert local_files_only and os.environ["HF_HUB_OFFLINE"] == "1"
    place = os.path.join(os.path.dirname(__file__), "weights.bin")
    if not os.path.exists(place):
        raise FileNotFoundError(repository)
    return place
"""

_WALL = f"""
import numpy as np
NORMAL, OFFSET = np.array({NORMAL}), {OFFSET}
def wall(matrix, world_from_camera, height, width, centre):
    v, u = np.mgrid[:height, :width] + centre
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1], np.ones_like(u)], -1)
    world = rays @ world_from_camera[:3, :3].T
    return ((OFFSET - NORMAL @ world_from_camera[:3, 3]) / (world @ NORMAL)).astype(np.float32)
"""

_DEPTH_ANYTHING_3 = """
import types
import numpy as np
import torch
from wall import wall
class DepthAnything3(torch.nn.Module):
    @classmethod
    def from_pretrained(cls, repository):
        assert repository == "depth-anything/DA3-BASE"
        return cls()
    def inference(self, image, extrinsics=None, intrinsics=None, align_to_input_ext_scale=True, process_res=504,
                  process_res_method="upper_bound_resize"):
        height, width, _ = image[0].shape
        assert image[0].dtype == np.uint8 and max(height, width) == process_res and height % 14 == width % 14 == 0
        assert extrinsics.shape[1:] == (4, 4) and intrinsics.shape[1:] == (3, 3)
        poses = np.linalg.inv(extrinsics)
        depth = [wall(k, pose, height, width, 0.5) for k, pose in zip(intrinsics, poses)]
        return types.SimpleNamespace(depth=np.stack(depth), conf=np.full((len(image), height, width), 2.0, np.float32),
                                     extrinsics=extrinsics[:, :3], intrinsics=intrinsics)
"""

_MAPANYTHING_IMAGE = """
import torch
def preprocess_inputs(views):
    made = []
    for view in views:
        height, width, _ = view["img"].shape
        assert (width, height) in ((518, 392), (392, 518))
        one = {"img": torch.from_numpy(view["img"]).permute(2, 0, 1)[None].float(), "data_norm_type": ["dinov2"]}
        one.update({name: torch.from_numpy(view[name])[None] for name in ("intrinsics", "camera_poses")})
        made.append(one | {"is_metric_scale": view["is_metric_scale"]})
    return made
"""

_MAPANYTHING = """
import torch
from wall import wall
class MapAnything(torch.nn.Module):
    @classmethod
    def from_pretrained(cls, repository):
        assert repository == "facebook/map-anything-apache"
        return cls()
    def infer(self, views, memory_efficient_inference=True, use_amp=True, apply_mask=True, mask_edges=True):
        told = []
        for view in views:
            height, width = view["img"].shape[-2:]
            assert view["is_metric_scale"].tolist() == [True]
            depth = wall(view["intrinsics"][0].numpy(), view["camera_poses"][0].numpy(), height, width, 0.0)
            told.append({"depth_z": torch.from_numpy(depth)[None, ..., None], "intrinsics": view["intrinsics"],
                         "conf": torch.full((1, height, width), 2.0), "camera_poses": view["camera_poses"]})
        return told
"""

_VGGT = """
import torch
class VGGT(torch.nn.Module):
    @classmethod
    def from_pretrained(cls, repository):
        assert repository == "facebook/VGGT-1B"
        return cls()
    def forward(self, images, query_points=None):
        assert images.ndim == 4 and images.shape[-1] == 518 and images.shape[-2] % 14 == 0
        depth = 1.0 / (images[None, :, 0] + 0.1)
        return {"pose_enc": torch.zeros(1, len(images), 9), "depth": depth[..., None], "depth_conf": 1.0 + 0.0 * depth}
"""

_POSE_ENC = """
import torch
def pose_encoding_to_extri_intri(pose_encoding, image_size_hw=None):
    count, (height, width) = pose_encoding.shape[1], image_size_hw
    matrix = torch.tensor([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    return torch.eye(4)[:3].repeat(1, count, 1, 1), matrix.repeat(1, count, 1, 1)
"""

_MOGE = """
import torch
class MoGeModel(torch.nn.Module):
    @classmethod
    def from_pretrained(cls, repository):
        assert repository == "Ruicheng/moge-2-vitb-normal"
        return cls()
    def infer(self, image, fov_x=None, use_fp16=True):
        assert image.shape[0] == 3 and 20 < fov_x < 120
        mask = image[2] < 0.5
        return {"depth": torch.where(mask, 1.0 / (image[0] + 0.1), torch.inf), "mask": mask}
"""

_DUST3R_IMAGE = """
import numpy as np
import torch
from PIL import Image
def load_images(files, size, verbose=True):
    loaded = []
    for index, file in enumerate(files):
        picture = np.asarray(Image.open(file))
        assert max(picture.shape) == size and picture.shape[0] % 16 == picture.shape[1] % 16 == 0
        loaded.append({"img": torch.from_numpy(picture).permute(2, 0, 1)[None].float() / 255.0 * 2 - 1, "idx": index})
    return loaded
"""

_DUST3R_INFERENCE = """
import torch
def inference(pairs, model, device, batch_size=8, verbose=True):
    ((first, second),) = pairs
    red = first["img"][:, 0] / 2 + 0.5
    v, u = torch.meshgrid(*(torch.arange(side) for side in red.shape[1:]), indexing="ij")
    # Only of the pair with the second picture is the first one's pointmap right, and that one is surest.
    right = second["idx"] == (first["idx"] + 1) % 3
    depth = 1.0 / (red + 0.1) * (1.0 if right else 3.0)
    points = torch.stack([u * depth, v * depth, depth], dim=-1)
    confidence = torch.full_like(depth, 5.0 if right else 2.0)
    return {"pred1": {"pts3d": points, "conf": confidence}, "pred2": {}}
"""

_NETWORK = """
import torch
class {name}(torch.nn.Module):
    @classmethod
    def from_pretrained(cls, repository):
        assert repository.startswith("naver/")
        return cls()
"""

_FILES = {
    "huggingface_hub.py": _HUB,
    "wall.py": _WALL,
    "weights.bin": "weights",
    "depth_anything_3/api.py": _DEPTH_ANYTHING_3,
    "mapanything/models/__init__.py": _MAPANYTHING,
    "mapanything/utils/image.py": _MAPANYTHING_IMAGE,
    "vggt/models/vggt.py": _VGGT,
    "vggt/utils/pose_enc.py": _POSE_ENC,
    "moge/model/v2.py": _MOGE,
    "dust3r/utils/image.py": _DUST3R_IMAGE,
    "dust3r/inference.py": _DUST3R_INFERENCE,
    "dust3r/model.py": _NETWORK.format(name="AsymmetricCroCo3DStereo"),
    "mast3r/model.py": _NETWORK.format(name="AsymmetricMASt3R"),
}
VERSIONS = {"depth-anything-3": "0.1.1", "mapanything": "1.1", "vggt": "0.0.1", "moge": "2.0.0"}


def write_stand_ins(folder: Path, **versions: str) -> Path:
    """The packages in ``folder``, of other ``versions`` if need be, with underscores for their hyphens."""
    for name, text in _FILES.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        for parent in file.relative_to(folder).parents:
            if parent != Path():
                (folder / parent / "__init__.py").touch()
    for package, version in VERSIONS.items():
        told = folder / f"{package.replace('-', '_')}-{version}.dist-info"
        told.mkdir()
        version = versions.get(package.replace("-", "_"), version)
        (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
    return folder
