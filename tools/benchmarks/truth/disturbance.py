"""A scene's captures as a poorer camera and a poorer pose estimate would have given them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.poses.cameras_json import read_cameras_json
from r2sego_blender.captures.poses.json_fields import read_json
from r2sego_blender.core.images import load_image, save_image
from r2sego_blender.core.json_files import write_json

NOISE_SIGMA = 4.0 / 255.0
GAIN = 0.05
TRANSLATION_M, ROTATION_DEG = 0.01, 0.3


def disturbed_captures(scene: Path, folder: Path, rng: np.random.Generator) -> None:
    """Write the captures of ``scene`` into ``folder``, disturbed: ``cameras.json`` and its PNGs.

    sRGB values (in [0, 1]) are multiplied by one gain an image, uniform within +-``GAIN``,
    get Gaussian noise of ``NOISE_SIGMA`` and are rounded to 8 bits again. Every camera is
    moved by ``TRANSLATION_M`` (in the poses' unit) in a random direction and turned by
    ``ROTATION_DEG`` about a random axis through its centre: these are the magnitudes
    themselves, not deviations of each axis. Frozen views are left out. Raises CaptureError
    for files that cannot be read.
    """
    data = read_json(scene / "cameras.json")
    photographs, _ = read_cameras_json(scene / "cameras.json", scene)
    entries = []
    for index, (photograph, entry) in enumerate(zip(photographs, data["captures"], strict=True)):
        image = load_image(photograph.path) * rng.uniform(1.0 - GAIN, 1.0 + GAIN)
        file = f"{index:04d}.png"
        save_image(folder / file, image + rng.normal(0.0, NOISE_SIGMA, image.shape))
        pose = disturbed_pose(photograph.world_from_camera, rng)
        entries.append(entry | {"file": file, "world_from_camera": pose.tolist()})
    shared = {key: value for key, value in data.items() if not key.startswith("frozen")}
    write_json(folder / "cameras.json", shared | {"captures": entries})


def disturbed_pose(
    world_from_camera: np.ndarray,
    rng: np.random.Generator,
    translation_m: float = TRANSLATION_M,
    rotation_deg: float = ROTATION_DEG,
) -> np.ndarray:
    """A (4, 4) pose, moved and turned by fixed magnitudes in random directions."""
    direction, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    pose = world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(np.radians(rotation_deg) * axis).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += translation_m * direction
    return pose
