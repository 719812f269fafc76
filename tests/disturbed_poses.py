"""Captures at poses that are a little wrong, as trackers give them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.capture import Capture

TURN_DEG, MOVE_M = 0.3, 0.01


def with_disturbed_poses(captures: Iterable[Capture], rng: np.random.Generator) -> list[Capture]:
    """Each capture moved by a centimetre and turned by 0.3 degrees in directions of their own."""
    disturbed = []
    for capture in captures:
        direction, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        pose = capture.camera.world_from_camera.copy()
        pose[:3, :3] = Rotation.from_rotvec(np.radians(TURN_DEG) * axis).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += MOVE_M * direction
        disturbed.append(replace(capture, camera=capture.camera.at(pose)))
    return disturbed
