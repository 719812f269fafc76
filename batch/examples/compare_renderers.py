"""How far Cycles or EEVEE agree with the z-buffer on a scene's proxy, seen from its captures.

python batch/examples/compare_renderers.py SCENE --renderer cycles [--blender /path/to/blender]

A frame's share of pixels: depth within 1 mm or 0.1 %, normals within 0.5 degrees where both
see a surface, equal provenance, validity and instance; and the seconds a frame took.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.cameras import Camera
from r2sego_blender.generation.conditions.blender_conditions import BlenderRenderer
from r2sego_blender.generation.conditions.conditions import Condition, ZBufferRenderer
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.workers.blender_renderer import BlenderWorker

EQUAL = ("provenance", "validity", "instance")


def off_centre(camera: Camera, width: int, height: int) -> tuple[Camera, ...]:
    """The camera's pose with a plain lens, one with fx != fy off centre, and a portrait one."""
    plain = Camera(width, height, 0.7 * width, 0.7 * width, width / 2, height / 2, camera.world_from_camera)
    skewed = replace(plain, fx=0.63 * width, fy=0.81 * width, cx=0.47 * width, cy=0.54 * height)
    return plain, skewed, replace(skewed, width=height, height=width, cx=0.42 * height, cy=0.55 * width)


def shares(found: Condition, expected: Condition) -> list[float]:
    """Per cent of pixels of depth, normal, provenance, validity and instance that agree."""
    seen = (found.depth > 0) & (expected.depth > 0)
    near = np.abs(found.depth - expected.depth) <= np.maximum(1e-3, 1e-3 * expected.depth)
    near &= (found.depth > 0) == (expected.depth > 0)
    cosine = np.sum(found.normal[seen] * expected.normal[seen], axis=-1, dtype=np.float64)
    agreements = [near, cosine >= np.cos(np.radians(0.5))]
    agreements += [getattr(found, name) == getattr(expected, name) for name in EQUAL]
    return [100.0 * float(agreement.mean()) for agreement in agreements]


def main(arguments: list[str]) -> int:
    """Print a line a frame and the worst of all; returns 0."""
    parser = argparse.ArgumentParser(prog="compare_renderers.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--renderer", choices=("cycles", "eevee"), default="cycles")
    parser.add_argument("--blender", default="", help="a Blender program; pip's bpy when left out")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--captures", type=int, default=3, help="captures looked from, three lenses each")
    options = parser.parse_args(arguments)
    if options.captures < 1:
        parser.error("--captures is one at least")
    bundle = Bundle.open(options.scene)
    proxy = bundle.proxy(bundle.rounds() - 1)
    captures = bundle.captures()
    chosen = captures[:: max(1, len(captures) // options.captures)][: options.captures]
    path = [camera for view in chosen for camera in off_centre(view.camera, *options.size)]
    worker = BlenderWorker(options.blender)
    renderer, z_buffer = BlenderRenderer(proxy, options.renderer, worker), ZBufferRenderer(proxy)
    print(f"{renderer.name}, {len(proxy.faces)} faces")
    print(f"{'lens':>10} {'depth':>9} {'normal':>9} " + " ".join(f"{name:>10}" for name in EQUAL) + "  seconds")
    rows = []
    for camera in path:
        begun = time.perf_counter()
        found = renderer.render([camera])[0]
        took_s = time.perf_counter() - begun
        rows.append(shares(found, z_buffer.condition(camera)))
        print(_line(f"{camera.width} x {camera.height}", rows[-1]) + f" {took_s:8.2f}")
    print(_line("worst", np.min(rows, axis=0)))
    return 0


def _line(name: str, values: list[float]) -> str:
    return f"{name:>10} {values[0]:9.3f} {values[1]:9.3f} " + " ".join(f"{v:10.3f}" for v in values[2:])


if __name__ == "__main__":
    run_script(main)
