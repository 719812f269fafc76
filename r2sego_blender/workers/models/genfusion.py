"""GenFusion in its own environment: its ``train.py`` and ``render.py``, each a process, on a data set written for them.

See ``evaluation.external_arms.genfusion``. What they read is a COLMAP model with one pinhole camera a picture, in its
binary format: the package that they read it with cannot read text under Python 3. Black pictures stand for the views.
Its arguments are the repository and the checkpoint.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..protocol.serving import Answer, RefusedError, Request, Tell, file_digest, serve

FOLDER = "Reconstruction"
FILES = ("train.py", "render.py", "generation_infer.yaml", "extrapolation/outpaint/sparse.py")
CHECKPOINT = "diffusion_ckpt/epoch=59-step=34000.ckpt"
"""In ``FOLDER``, as its scripts name it."""

LEAST_PX = (960, 540)
"""Smaller pictures are enlarged to these: its cut for the diffusion model, 960 x 512, has to lie within them."""

PUBLISHED_STEPS = 7000
_STAGES = {"start_diffusion_iter": 1000, "diffusion_every": 1000, "diffusion_until": 7000, "densify_until_iter": 5000}
_PUBLISHED: Mapping[str, Any] = {
    "num_frames": 16,
    "outpaint_type": "sparse",
    "diffusion_resize_width": 960,
    "diffusion_resize_height": 512,
    "diffusion_crop_width": 960,
    "diffusion_crop_height": 512,
    "densify_from_iter": 100,
    "densification_interval": 500,
    "opacity_reset_interval": 3100,
    "lambda_dist": 10.0,
    "lambda_dssim": 0.5,
    "lambda_reg": 1.0,
    "unconditional_guidance_scale": 3.2,
}
_SWITCHES = ("depth_loss", "mono_depth", "repair")
_PINHOLE = 1  # COLMAP's number of that model
_LABEL = "GenFusion"
_WORDS, _SAYS_EVERY = 20, 50


def options_of(steps: int, captures: int) -> dict[str, str]:
    """What ``train.py`` is given besides places: its own settings for few views, in a training of so many steps."""
    stages = {name: max(1, steps * step // PUBLISHED_STEPS) for name, step in _STAGES.items()}
    given = {**_PUBLISHED, **stages, "iterations": steps, "test_iterations": -1, "sparse_view": captures}
    return {f"--{name}": str(value) for name, value in {**given, "data_factor": 1, "port": 0}.items()}


def enlargement(sizes: np.ndarray) -> float:
    """By what all pictures of ``sizes`` (n, 2), width and height, are enlarged."""
    return float(max(1.0, (np.array(LEAST_PX) / sizes.min(axis=0)).max()))


def write_data_set(request: Request, folder: Path) -> None:
    """The captures, black pictures for the views, the split and the model, all enlarged alike."""
    from PIL import Image

    sizes = np.concatenate([request.array("capture_sizes"), request.array("view_sizes")])
    count = len(request.array("capture_sizes"))
    larger = np.ceil(sizes * enlargement(sizes) - 1e-6).astype(int)
    names = [f"capture_{k:03d}.png" if k < count else f"view_{k - count:03d}.png" for k in range(len(sizes))]
    (folder / "images").mkdir(parents=True)
    for number, name in enumerate(names):
        picture = Image.new("RGB", (int(larger[number, 0]), int(larger[number, 1])))
        if number < count:
            photograph = Image.fromarray(request.array(f"photograph_{number:03d}"))
            picture = photograph.resize(picture.size, Image.Resampling.LANCZOS)
        picture.save(folder / "images" / name, compress_level=1)
    split = {"train_ids": list(range(count)), "test_ids": list(range(count, len(names)))}
    (folder / f"train_test_split_{count}.json").write_bytes(json.dumps(split).encode())
    lenses = np.concatenate([request.array("capture_lenses"), request.array("view_lenses")])
    poses = np.concatenate([request.array("capture_poses"), request.array("view_poses")])
    visibility = request.array("visibility").copy()
    visibility[0, ~visibility.any(axis=0)] = True  # its reader wants a point of every image
    larger_lenses = lenses * np.tile(larger / sizes, 2)
    colours = request.array("colours")
    write_model(
        folder / "sparse" / "0", names, larger, larger_lenses, poses, request.array("points"), colours, visibility
    )


def write_model(
    folder: Path,
    names: Sequence[str],
    sizes: np.ndarray,
    lenses: np.ndarray,
    poses: np.ndarray,
    points: np.ndarray,
    colours: np.ndarray,
    visibility: np.ndarray,
) -> None:
    """A COLMAP model of images ``names``, each with a pinhole camera of its own, in binary files.

    ``sizes`` (n, 2) width and height, ``lenses`` (n, 4) fx fy cx cy, ``poses`` (n, 4, 4) camera_from_world; ``points``
    (P, 3), ``colours`` (P, 3) uint8 and ``visibility`` (P, m): which of the first m images see each. A point that none
    sees is left out.
    """
    from scipy.spatial.transform import Rotation

    folder.mkdir(parents=True)
    with (folder / "cameras.bin").open("wb") as stream:
        stream.write(struct.pack("<Q", len(names)))
        for index, size in enumerate(sizes):
            stream.write(struct.pack("<IiQQ4d", index + 1, _PINHOLE, *map(int, size), *lenses[index]))
    turns = np.roll(Rotation.from_matrix(poses[:, :3, :3]).as_quat(), 1, axis=1)  # w first
    with (folder / "images.bin").open("wb") as stream:
        stream.write(struct.pack("<Q", len(names)))
        for index, name in enumerate(names):
            stream.write(struct.pack("<I7dI", index + 1, *turns[index], *poses[index, :3, 3], index + 1))
            rows = np.flatnonzero(visibility[:, index]) if index < visibility.shape[1] else np.zeros(0, int)
            measured = np.zeros(len(rows), [("pixel", "<f8", 2), ("point", "<u8")])
            measured["pixel"] = _projected(points[rows], poses[index], lenses[index])
            measured["point"] = rows + 1
            stream.write(name.encode("ascii") + b"\0" + struct.pack("<Q", len(rows)) + measured.tobytes())
    places = np.cumsum(visibility, axis=0) - 1  # of each point among those of an image
    seen = np.flatnonzero(visibility.any(axis=1))
    with (folder / "points3D.bin").open("wb") as stream:
        stream.write(struct.pack("<Q", len(seen)))
        for row in seen:
            track = np.flatnonzero(visibility[row])
            stream.write(struct.pack("<Q3d3BdQ", row + 1, *points[row], *map(int, colours[row]), 0.0, len(track)))
            stream.write(np.stack([track + 1, places[row, track]], axis=1).astype("<u4").tobytes())


def _projected(points: np.ndarray, pose: np.ndarray, lens: np.ndarray) -> np.ndarray:
    """(P, 2) pixels of points (P, 3)."""
    seen = points @ pose[:3, :3].T + pose[:3, 3]
    projected: np.ndarray = seen[:, :2] / seen[:, 2:] * lens[:2] + lens[2:]
    return projected


class Views:
    """The task "views", with the repository and the checkpoint."""

    def __init__(self, repository: Path, checkpoint: Path) -> None:
        self._place, self._checkpoint = repository / FOLDER, checkpoint

    def views(self, request: Request, progress: Tell) -> Answer:
        """``view_000`` and on, as ``render.py`` shows them, brought back to their sizes."""
        from PIL import Image

        sizes = request.array("view_sizes")
        if not len(request.array("points")):
            raise RefusedError("it has no point to begin with")
        with tempfile.TemporaryDirectory(prefix="r2sego-") as temporary:
            data, made = Path(temporary, "data"), Path(temporary, "made")
            write_data_set(request, data)
            places = ["--data_dir", str(data), "-m", str(made)]
            diffusion = ["--diffusion_ckpt", str(self._checkpoint), "--diffusion_config", "./generation_infer.yaml"]
            options = options_of(request.parameters["steps"], len(request.array("capture_sizes")))
            given = [word for pair in options.items() for word in pair]
            self._run(["train.py", *places, *diffusion, *given, *(f"--{name}" for name in _SWITCHES)], progress)
            self._run(["render.py", *places, "--skip_train", "--skip_mesh"], progress)
            outputs = {}
            for number, (width, height) in enumerate(sizes.tolist()):
                with Image.open(made / "test" / "renders" / f"view_{number:03d}.png") as image:
                    view = image.convert("RGB").resize((width, height), Image.Resampling.BOX)
                outputs[f"view_{number:03d}"] = np.asarray(view, np.uint8)
        return Answer(f"{_LABEL} ({self._checkpoint.name})", file_digest(self._checkpoint), outputs)

    def _run(self, command: Sequence[str], progress: Tell) -> None:
        """Run one of its programs to its end. Raises RuntimeError, with its last words, where it fails."""
        words: deque[str] = deque(maxlen=_WORDS)
        with subprocess.Popen(
            [sys.executable, *command],
            cwd=self._place,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            encoding="utf-8",
            errors="replace",
        ) as process:
            assert process.stdout is not None
            for count, line in enumerate(process.stdout):  # a bar that is drawn anew is a line each time
                words.append(line.strip())
                if count % _SAYS_EVERY == 0:
                    progress(0, 1, f"{_LABEL}: {command[0]}")
        if process.returncode:
            last = next(filter(None, reversed(words)), "")
            raise RuntimeError(f"{command[0]} ended with status {process.returncode}: {last}")


def main(repository: str, checkpoint: str) -> None:
    """Serve views."""
    serve({"views": Views(Path(repository), Path(checkpoint)).views})
