"""*All Data* of 3D Scanner App (3dscannerapp.com): ``frame_00000.jpg`` with ``frame_00000.json``, depth and confidence.

The app has no description of it. As programs that read it agree: ``cameraPoseARFrame`` is ARKit's camera to world, row
by row, OpenGL axes, metres, +Y up; ``intrinsics`` are row by row, in pixels of the photograph; ``depth_00000.png`` is
LiDAR depth in millimetres and ``conf_00000.png`` ARKit's confidence, where the scan has them. Photographs are kept of
some frames, JSON of all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..lenses.lens import Lens
from ..sensors.sensor_depth import SensorDepth
from . import json_fields as fields
from .photographs import Photograph, photograph_size, require_lens_of_size
from .polycam import LIDAR_RANGE_M
from .trajectories import numbered_frames
from .transforms_json import GL_FROM_CV

FRAME, POSE = "frame_", "cameraPoseARFrame"


def read_three_d_scanner_app(folder: Path) -> list[Photograph]:
    """The photographs of an export, in metres with +Y up. Raises CaptureError for one without its pose or lens."""
    photographs = []
    for path in numbered_frames(folder, FRAME).values():
        file = path.with_suffix(".json")
        data = fields.read_json(file)
        pose = fields.array(POSE, file, POSE, data, (16,)).reshape(4, 4) @ GL_FROM_CV
        matrix = fields.array("intrinsics", file, "intrinsics", data, (9,)).reshape(3, 3)
        width, height, _ = photograph_size(path)
        lens = Lens(width, height, *matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist())
        photographs.append(Photograph(path.name, path, lens, pose, str(file)))
    if photographs:
        require_lens_of_size(photographs[0].lens, photographs[0].source, ("width", "height"))
    return photographs


def lidar_depth(photographs: Sequence[Photograph]) -> SensorDepth | None:
    """The depth maps beside the photographs, if any has one."""
    depth, confidence = (_beside(photographs, kind) for kind in ("depth_", "conf_"))
    folder = photographs[0].path.parent if photographs else Path()
    return SensorDepth(folder, None, LIDAR_RANGE_M, files=depth, confidence_files=confidence) if depth else None


def _beside(photographs: Sequence[Photograph], kind: str) -> Mapping[str, Path]:
    files = {one.name: one.path.with_name(f"{kind}{one.path.stem.removeprefix(FRAME)}.png") for one in photographs}
    return {name: file for name, file in files.items() if file.is_file()}
