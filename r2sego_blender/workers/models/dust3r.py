"""DUSt3R and MASt3R asked through dust3r's ``inference`` of pairs: see ``geometry.estimators.dust3r``.

Neither is a package: their repositories are on the environment's path, as ``r2sego backend install`` puts them.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..protocol.serving import Answer, Request, Tell
from .loading import Loaded, device_of, packages_of, run, weights_file

_LABELS = {"dust3r": "DUSt3R", "mast3r": "MASt3R"}
_REPOSITORIES = {
    "dust3r": "naver/DUSt3R_ViTLarge_BaseDecoder_512_dpt",
    "mast3r": "naver/MASt3R_ViTLarge_BaseDecoder_512_catmlpdpt_metric",
}
_UNBOUNDED = float("inf")
_TINY = {
    "pos_embed": "RoPE100",
    "img_size": (512, 512),
    "landscape_only": False,
    "depth_mode": ("exp", -_UNBOUNDED, _UNBOUNDED),
    "conf_mode": ("exp", 1, _UNBOUNDED),
    "enc_embed_dim": 64,
    "enc_depth": 2,
    "enc_num_heads": 2,
    "dec_embed_dim": 64,
    "dec_depth": 2,
    "dec_num_heads": 2,
}  # for random weights


def _load(name: str, random: bool) -> Any:
    with packages_of(_LABELS[name]):
        import torch

        if name == "mast3r":
            from mast3r.model import AsymmetricMASt3R as Network
        else:
            from dust3r.model import AsymmetricCroCo3DStereo as Network
    if random and name == "dust3r":
        made = Network(output_mode="pts3d", head_type="linear", **_TINY)
    elif random:
        made = Network(output_mode="pts3d+desc24", head_type="catmlp+dpt", two_confs=True, **_TINY | {"dec_depth": 12})
    else:
        made = Network.from_pretrained(_REPOSITORIES[name])
    return made.to(device_of(torch)).eval()


def _weights(name: str) -> Path:
    return weights_file(_REPOSITORIES[name], "model.safetensors", _LABELS[name])


_LOADED = Loaded(_load, _weights)


def depth(request: Request, progress: Tell) -> Answer:
    """``pts3d`` and ``confidence`` of each picture, of that of its pairs that is surest of it."""
    label = _LABELS[request.backend]
    pictures, pairs = request.array("pictures"), request.array("pairs")
    progress(0, len(pairs), label)
    model, digest = _LOADED.model(request)  # mast3r puts dust3r on the path
    with packages_of(label):
        import torch
        from dust3r.inference import inference
        from dust3r.utils.image import load_images
        from PIL import Image
    with tempfile.TemporaryDirectory(prefix="r2sego-") as folder:
        files = [str(Path(folder, f"{index:04d}.png")) for index in range(len(pictures))]
        for index, file in enumerate(files):
            Image.fromarray(pictures[index]).save(file)
        images = load_images(files, size=512, verbose=False)
    points = np.zeros((*pictures.shape[:3], 3), np.float32)
    confidence = np.zeros(pictures.shape[:3], np.float32)
    for done, (first, second) in enumerate(pairs.tolist()):
        said = inference([(images[first], images[second])], model, device_of(torch), batch_size=1, verbose=False)
        sure = said["pred1"]["conf"][0].float().cpu().numpy()
        if sure.mean() > confidence[first].mean():
            confidence[first] = sure
            points[first] = said["pred1"]["pts3d"][0].float().cpu().numpy()
        progress(done + 1, len(pairs), label)
    return Answer(label, digest, {"pts3d": points, "confidence": confidence})


def main(*arguments: str) -> None:
    """The worker."""
    run({"depth": depth}, _LOADED, arguments)
