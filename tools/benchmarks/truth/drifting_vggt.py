"""Responses as VGGT's, recorded of true poses that drift: its role in registration without a GPU or weights."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.geometry.estimators.placement import Placement
from r2sego_blender.geometry.estimators.vggt import Estimator
from r2sego_blender.workers.protocol.serving import Answer, write_answer

from .disturbance import disturbed_pose

DRIFT_M, DRIFT_DEG = 0.05, 3.0
BACKEND = "true poses that drift"


def record_drifting(
    folder: Path,
    cameras: Sequence[Camera],
    depth: np.ndarray,
    rng: np.random.Generator,
    drift_m: float = DRIFT_M,
    drift_deg: float = DRIFT_DEG,
) -> None:
    """Write into ``folder`` what a ``RecordedWorker`` answers to the next request of the task "registration".

    ``cameras`` are the true ones of the request's pictures, the reference first; each other is moved and turned by
    fixed magnitudes in random directions. ``depth`` (H, W) is the reference's, planar, in the cameras' unit, 0
    unknown. Lengths are told in a random unit, as VGGT's are.
    """
    places = Estimator("vggt").placements([(camera.width, camera.height) for camera in cameras])
    unit = float(np.exp(rng.uniform(-1.0, 1.0)))
    reference, *others = cameras
    drifted = [reference, *(one.at(disturbed_pose(one.world_from_camera, rng, drift_m, drift_deg)) for one in others)]
    poses = np.stack([one.camera_from_world @ reference.world_from_camera for one in drifted])[:, :3]
    poses[:, :, 3] /= unit
    depths = np.ones((len(cameras), places[0].height, places[0].width), np.float32)
    depths[0] = _pictured(depth, places[0]) / unit
    outputs = {
        "depth": depths,
        "confidence": np.where(depths > 0.0, np.float32(2.0), np.float32(1.0)),
        "intrinsics": np.stack([place.matrix(one) for place, one in zip(places, cameras, strict=True)]),
        "camera_from_world": poses,
    }
    response = folder / "registration"
    response.mkdir(parents=True)
    write_answer(response, "registration", Answer(BACKEND, "", outputs), time.monotonic())


def _pictured(depth: np.ndarray, place: Placement) -> np.ndarray:
    """Depth (H, W) of a photograph, at the pixels (height, width) of its picture; 0 beside it."""
    height, width = depth.shape
    rows = np.floor((np.arange(place.height) + 0.5 - place.top) * height / place.down).astype(np.int64)
    columns = np.floor((np.arange(place.width) + 0.5 - place.left) * width / place.across).astype(np.int64)
    inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))[None, :]
    shown = depth[np.ix_(rows.clip(0, height - 1), columns.clip(0, width - 1))]
    return np.where(inside, shown, np.float32(0.0))
