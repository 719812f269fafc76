"""Rendered walks through Replica (Straub et al. 2019), in the two layouts in circulation; both are in metres.

Of Semantic-NeRF (Zhi et al. 2021): ``rgb/rgb_0.png`` and ``traj_w_c.txt``, the lens that of its trainer. Of
NICE-SLAM (Zhu et al. 2022): ``results/frame000000.jpg`` and ``traj.txt``; the lens is in ``cam_params.json`` above,
or that of its configuration for Replica. Both releases count pixels' centres in whole numbers. Depth and
semantics beside the frames are the model's own: nothing here looks at them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...core.errors import CaptureError
from ..lenses.lens import Lens
from . import json_fields as fields
from .photographs import Photograph, photograph_size
from .replica_files import FRAMES, SEMANTIC_NERF
from .trajectories import numbered_frames, posed_frames

_LENS_FILE = "cam_params.json"
_OF_NICE_SLAM = {"w": 1200, "h": 680, "fx": 600.0, "fy": 600.0, "cx": 599.5, "cy": 339.5}
_HALF_PX = 0.5  # here the first pixel's centre is (0.5, 0.5)


def read_walk(file: Path) -> list[Photograph]:
    """All frames of a walk, in order, in metres. Raises CaptureError."""
    folder, stem = FRAMES[file.name]
    frames = numbered_frames(file.parent / folder, stem)
    if not frames:
        cure = f"Give them as the release has them: {folder}/{stem}...."
        raise CaptureError("there are no frames", where=file.parent / folder, cure=cure)
    lens = _square_lens(next(iter(frames.values()))) if file.name == SEMANTIC_NERF else _declared_lens(file)
    return posed_frames(file, frames, lens)


def _square_lens(frame: Path) -> Lens:
    """A quarter turn across the frame, its middle in the middle; releases differ in size alone."""
    width, height, _ = photograph_size(frame)
    return Lens(width, height, width / 2, width / 2, width / 2, height / 2)


def _declared_lens(file: Path) -> Lens:
    told: dict[str, Any] = _OF_NICE_SLAM
    place = next((one / _LENS_FILE for one in (file.parent, file.parent.parent) if (one / _LENS_FILE).is_file()), file)
    if place is not file:
        told = fields.read_json(place).get("camera", {})
        if not isinstance(told, dict):
            raise CaptureError("'camera' is no object", where=place, cure="Copy it from the release again.")
    width, height = fields.size(place, "camera", told, keys=("w", "h"))
    fx, fy = (fields.number(key, place, "camera", told, positive=True) for key in ("fx", "fy"))
    cx, cy = (fields.number(key, place, "camera", told) + _HALF_PX for key in ("cx", "cy"))
    return Lens(width, height, fx, fy, cx, cy)
