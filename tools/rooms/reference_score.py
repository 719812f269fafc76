"""How near a reference room's pictures are to those of Cycles at frozen views, and what one takes.

    python -m tools.rooms.reference_score --reference DIR --frozen demo/room/cameras.json [--width 128 320]

Frozen pictures are reduced to each width by the mean over areas. Prints the PSNR of each view, their mean and least.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from r2sego_blender.captures.poses.cameras_json import read_frozen
from r2sego_blender.captures.poses.photographs import ANY_SIZE_PX, capture_of
from r2sego_blender.core.images import resize
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField
from r2sego_blender.splats.metrics import psnr


def scores(field: SurfaceLightField, frozen: Path, width: int) -> tuple[np.ndarray, float]:
    """PSNR (N,) dB of the frozen views at ``width`` pixels, and seconds of processor a picture takes."""
    found, taken_s = [], []
    for photograph in read_frozen(frozen, frozen.parent):
        capture = capture_of(photograph, ANY_SIZE_PX)
        camera = capture.camera.scaled(width / capture.camera.width)
        true = resize(capture.image(), camera.width, camera.height)
        began_s = time.process_time()
        colour, _ = field.render(camera)
        taken_s.append(time.process_time() - began_s)
        found.append(psnr(colour, true))
    return np.array(found), float(np.median(taken_s))


def main() -> None:
    """Score one reference room."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--reference", type=Path, required=True, help="the folder of a reference room")
    parser.add_argument("--frozen", type=Path, required=True, help="a cameras.json with frozen views")
    parser.add_argument("--width", type=int, nargs="+", default=(128, 320), help="pixels across")
    options = parser.parse_args()
    field = SurfaceLightField.load(options.reference / "light.npz")
    for width in options.width:
        found, taken_s = scores(field, options.frozen, width)
        each = " ".join(f"{one:.1f}" for one in found)
        print(f"{width} px: mean {found.mean():.2f} dB, least {found.min():.1f}; {1e3 * taken_s:.1f} ms; {each}")


if __name__ == "__main__":
    main()
