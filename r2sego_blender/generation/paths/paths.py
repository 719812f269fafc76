"""Camera paths tau_v: from the reference capture to the target view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ...core.cameras import Camera
from .detours import along


def eased(frames: int) -> np.ndarray:
    """(frames,) float64 from 0 to 1, never falling, at rest at both ends (smoothstep)."""
    time = np.linspace(0.0, 1.0, frames)
    return time * time * (3.0 - 2.0 * time)


def camera_path(reference: Camera, target: Camera, frames: int, way: np.ndarray | None = None) -> tuple[Camera, ...]:
    """N_f cameras from the reference's pose to exactly the target's, with the target's lens.

    Rotations follow the shortest great arc (slerp), and centres a straight line or ``way``,
    the points (n, 3) of a detour from the one centre to the other (``detours.ClearSpace``);
    both with the same easing, so the motion starts and ends at rest. ``frames`` is at least 2.
    """
    if frames < 2:
        raise ValueError("a camera path has at least two frames")
    ends = np.stack([reference.world_from_camera[:3, :3], target.world_from_camera[:3, :3]])
    shares = eased(frames)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends))(shares).as_matrix()
    poses[:, :3, 3] = along(np.stack([reference.centre, target.centre]) if way is None else way, shares)
    poses[0], poses[-1] = reference.world_from_camera, target.world_from_camera
    return tuple(target.at(pose) for pose in poses)


def reference_from_frame(reference: Camera, path: Sequence[Camera]) -> np.ndarray:
    """(N_f, 4, 4) float64: the path's poses relative to the reference, the paper's bar pi_v,t."""
    return np.stack([reference.camera_from_world @ camera.world_from_camera for camera in path])
