"""A real office in parts, with and without its depth sensor, from photographs to scores.

    python -m tools.results.office --data ../shared --to build [--split a ...] [--depth] [--preset preview]

``--data`` is a folder with ``captures/holo_office``: 63 photographs of one walk with their poses and depth.
``a``, ``b`` and ``c`` are thirds of it, twelve captures and nine held out between them; of ``away_a`` and
``away_b`` the held-out photographs are of another stretch of the walk, which sees the same things. All were
fixed by index before any result was seen. What the sensor saw is compared with the proxy and with completed
depth, and held-out photographs with the refined asset, vanilla 3DGS, and the strongest baseline: the same
observed points at this project's rates, without rounds.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sensors.sensor_depth import SensorDepth
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.ego_views import VIEWS
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.geometry.room.completed_depth import COMPLETED

from .measure import run_r2sego

_HELD_OUT_OF_SEVEN = (1, 3, 5)


def _third(first: int) -> tuple[Sequence[int], Sequence[int]]:
    held_out = [index for index in range(first, first + 21) if (index - first) % 7 in _HELD_OUT_OF_SEVEN]
    return [index for index in range(first, first + 21) if index not in held_out], held_out


SPLITS: dict[str, tuple[Sequence[int], Sequence[int]]] = {
    "a": _third(0),
    "b": _third(21),
    "c": _third(42),
    "away_a": ((30, 31, 33, 34, 36, 37, 39, 40, 41, 43, 45, 47), (3, 4, 5, 6, 7, 56, 58, 59, 60, 61)),
    "away_b": (tuple(range(12)), (21, 29, 30, 31, 32, 33, 44, 45, 46, 59, 60)),
}
"""Captures and held-out photographs, by their places in the walk."""


def prepare(data: Path, folder: Path, split: str) -> Path:
    """Copies of the photographs with their ``cameras.json``, and the captures' depth; the folder of both."""
    source = data / "captures" / "holo_office"
    lens, poses = np.loadtxt(source / "K.txt"), np.loadtxt(source / "poses_c2w.txt").reshape(-1, 4, 4)
    photographs, maps = (sorted((source / name).iterdir()) for name in ("images", "depth"))
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "photographs").mkdir(parents=True)
    (folder / "depth").mkdir()
    entries = []
    for indices in SPLITS[split]:
        entries.append([{"file": photographs[i].name, "world_from_camera": poses[i].tolist()} for i in indices])
        for i in indices:
            shutil.copy(photographs[i], folder / "photographs")
            shutil.copy(maps[i], folder / "depth" / f"{photographs[i].stem}{maps[i].suffix}")
    cameras = {"metric": True, "width": 540, "height": 360, "fx": lens[0, 0], "fy": lens[1, 1]}
    cameras |= {"cx": lens[0, 2], "cy": lens[1, 2], "captures": entries[0], "frozen": entries[1]}
    (folder / "photographs" / "cameras.json").write_text(json.dumps(cameras, indent=1) + "\n")
    return folder


def geometry_figures(scene: Scene, depth: SensorDepth) -> dict[str, Any]:
    """Shares of what the sensor saw of each capture that the proxy has within 5 cm and completed depth within 10 %."""
    captures = scene.read(CAPTURES)
    metre = np.float32(np.cbrt(np.linalg.det(np.array(scene.declaration.world_from_capture)[:3, :3])))
    sensed = [_sensed(capture, depth) * metre for capture in captures]
    completed = [
        resize_nearest(one.depth, *capture.camera.shape)
        for one, capture in zip(scene.read(COMPLETED).of(captures), captures, strict=True)
    ]
    figures: dict[str, Any] = {"completed_within_10_percent": _share(completed, sensed, relative=0.1)}
    for index in range(scene.rounds_done()):
        renderer = ZBufferRenderer(scene.read(PROXY.of_round(index)))
        seen = [renderer.depth(capture.camera) for capture in captures]
        figures[f"proxy_{index}_within_5_cm"] = _share(seen, sensed, metres=0.05)
        figures[f"views_kept_{index}"] = len(scene.read(VIEWS.of_round(index)))
    return figures


def _sensed(capture: Capture, depth: SensorDepth) -> np.ndarray:
    found = depth.of(capture, Path(capture.name).stem)
    assert found is not None
    return resize_nearest(found, *capture.camera.shape)


def _share(
    found: Sequence[np.ndarray], sensed: Sequence[np.ndarray], metres: float = 0.0, relative: float = 0.0
) -> float:
    near = [np.abs(a - b)[b > 0.0] <= metres + relative * b[b > 0.0] for a, b in zip(found, sensed, strict=True)]
    return round(float(np.concatenate(near).mean()), 4)


def measure(data: Path, work: Path, split: str, with_depth: bool, preset: str) -> dict[str, Any]:
    """New, refine, evaluate and compare; a scene that was begun goes on where it stopped."""
    name = f"office_{split}_{'depth' if with_depth else 'plain'}"
    folder, scene = prepare(data, work / name, split), work / f"{name}.r2s"
    cameras = folder / "photographs" / "cameras.json"
    if not scene.exists():
        depth = ["--depth", str(folder / "depth")] if with_depth else []
        run_r2sego("new", scene, "--captures", cameras.parent, "--poses", cameras, *depth)
    run_r2sego("refine", scene, "--preset", preset)
    run_r2sego("evaluate", scene, "--frozen", cameras)
    opened = Scene.open(scene)
    arms = json.loads(opened.metrics_file.read_text())["arms"]
    return {
        "split": split,
        "depth": with_depth,
        **geometry_figures(opened, SensorDepth(folder / "depth")),
        **{arm: [scored[key] for key in ("psnr", "ssim")] for arm, scored in arms.items()},
    }


def main() -> None:
    """Measure the chosen splits, one after the other; each prints a line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with captures/holo_office")
    parser.add_argument("--to", type=Path, required=True, help="folder for the bundles")
    parser.add_argument("--split", action="append", choices=list(SPLITS), help="default: all")
    parser.add_argument("--depth", action="store_true", help="with the sensor's depth")
    parser.add_argument("--preset", default="preview")
    arguments = parser.parse_args()
    arguments.to.mkdir(parents=True, exist_ok=True)
    for split in arguments.split or SPLITS:
        figures = measure(arguments.data, arguments.to, split, arguments.depth, arguments.preset)
        print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
