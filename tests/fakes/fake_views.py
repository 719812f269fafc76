"""The generated views of a small bundle's round: two accepted, one rejected, one that stood in."""

import json
from pathlib import Path

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import save_image

REJECTED = 1
STANDS_IN = 3
CLIP_FRAMES = 4
DEPTH_M = (1.5, 3.0)
"""The depth condition's nearest and farthest."""


def write_views(folder: Path, query: Camera, candidates: tuple[int, ...]) -> None:
    """Fill ``rounds/<l>/views``: a clip, a kept frame and conditions for each but the rejected."""
    for rank, candidate in enumerate(candidates):
        view = folder / f"{rank:03d}"
        view.mkdir(parents=True, exist_ok=True)
        accepted = rank != REJECTED
        record = {
            "accepted": accepted,
            "generator": "geometry-guided blending",
            "rank": rank,
            "reason": "registered: 90 of 100 patches agree" if accepted else "rejected: no patch is found",
            "candidate": candidate,
            "rollout": candidate // 10,
            "frame": candidate % 10,
            "reference": 1,
            "reference_name": "capture_1",
            "overlap": 0.7,
            "query": query.to_json(),
            "estimate": query.to_json() if accepted else None,
            "expected": 100,
            "matches": 95,
            "inliers": 90 if accepted else 0,
            "spread": 0.75,
        }
        if accepted:
            record |= {"offset_m": 0.012, "turn_deg": 0.25, "focal_px": query.fx, "sigma_m": 0.006, "sigma_deg": 0.2}
            _write_pictures(view, rank, query)
        (view / "pose.json").write_text(json.dumps(record))


def _write_pictures(view: Path, rank: int, query: Camera) -> None:
    height, width = query.shape
    (view / "clip").mkdir(exist_ok=True)
    for frame in range(CLIP_FRAMES):
        size = (height, width) if frame == CLIP_FRAMES - 1 else (height // 2, width // 2)
        save_image(view / "clip" / f"{frame:03d}.png", np.full((*size, 3), 0.1 * frame + 0.2, np.float32))
    shade = np.linspace(0.0, 1.0, height * width, dtype=np.float32).reshape(height, width)
    save_image(view / "frame.png", np.stack([shade, 1.0 - shade, np.full_like(shade, 0.1 * rank)], axis=-1))
    save_image(view / "confidence.png", shade)
    conditions = view / "conditions"
    conditions.mkdir(exist_ok=True)
    _write_depth(conditions / "000_depth.png", height, width)
    kinds = np.arange(height * width).reshape(height, width) % 4
    save_image(conditions / "000_provenance.png", kinds.astype(np.uint8))
    save_image(conditions / "000_normal.png", np.full((height, width, 3), 0.5, np.float32))
    save_image(conditions / "000_points.png", np.full((height, width, 3), 0.25, np.float32))


def _write_depth(file: Path, height: int, width: int) -> None:
    import cv2

    millimetres = np.zeros((height, width), np.uint16)
    millimetres[:, width // 2 :] = round(1000 * DEPTH_M[1])
    millimetres[:, : width // 4] = round(1000 * DEPTH_M[0])
    file.write_bytes(cv2.imencode(".png", millimetres)[1].tobytes())
