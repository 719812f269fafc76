"""Run rooms whose six captures hardly overlap: with recorded depth that is off, and with the room's layout alone.

    python -m tools.results.around --data ROOMS --to build [--room demo ...] [--kind layout] [--error 0.05]

``ROOMS`` are what ``tools.rooms.around`` makes. Each line of JSON says how much of each capture's completed depth
is right, how far off the collision floor is, how many rollouts walk, and how the frozen views score with the
refined asset, vanilla 3DGS, and the strongest baseline: the same points at this project's rates, without rounds.
What is recorded is the true depth disturbed, which is otherwise for scoring alone.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.evaluation.ground_truth import load_ground_truth
from r2sego_blender.generation.ego_views import VIEWS
from r2sego_blender.geometry.room.completed_depth import COMPLETED
from r2sego_blender.robot.rollouts.rollout import ROLLOUTS

from ..studies.disturbed_depth import ALL, disturbed
from .measure import run_r2sego

_FLOOR_M = 0.01  # of true surface from z = 0, that is floor
_ABOVE_M = 0.3  # where rays onto the floor start: below tables
_RAYS = 3000
KINDS = ("recorded", "layout")


def true_depths(scene: Scene, cameras: Path) -> list[np.ndarray]:
    """The true depth (H, W) of each capture, metres, 0 where there is no surface."""
    truth = load_ground_truth(cameras.parent).transformed(np.array(scene.declaration.world_from_capture))
    return [
        resize_nearest(view.depth, *capture.camera.shape)
        for view, capture in zip(truth.views, scene.read(CAPTURES), strict=True)
    ]


def within(scene: Scene, true: list[np.ndarray], tolerance: float) -> float:
    """The share of the captures' pixels with a surface where completed depth is right within ``tolerance``."""
    captures = scene.read(CAPTURES)
    near = [
        (np.abs(resize_nearest(one.depth, *truth.shape) - truth) <= tolerance * truth)[truth > 0.0]
        for one, truth in zip(scene.read(COMPLETED).of(captures), true, strict=True)
    ]
    return round(float(np.concatenate(near).mean()), 4)


def floor_heights_m(scene: Scene, true: list[np.ndarray]) -> np.ndarray:
    """Heights (n,) at which rays straight down onto the collision surface end where captures see true floor.

    Floor under something else is not asked: rays start 30 cm above it.
    """
    import mujoco

    points = [one.camera.unproject(truth)[truth > 0.0] for one, truth in zip(scene.read(CAPTURES), true, strict=True)]
    floor = np.concatenate(points)
    floor = floor[np.abs(floor[:, 2]) < _FLOOR_M]
    floor = floor[np.random.default_rng(0).permutation(len(floor))[:_RAYS]]
    model = mujoco.MjModel.from_xml_path(str(scene.collision_folder / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    met, down = np.zeros(1, np.int32), np.array([0.0, 0.0, -1.0])
    heights = []
    for x, y, _ in floor:
        distance = mujoco.mj_ray(model, data, np.array([x, y, _ABOVE_M]), down, None, 1, -1, met)
        heights.append(_ABOVE_M - distance if distance >= 0.0 else np.inf)
    return np.array(heights)


def measure(data: Path, work: Path, room: str, kind: str, error: float, preset: str) -> dict[str, Any]:
    """New, refine, evaluate and compare one room; a scene that was begun goes on where it stopped."""
    folder, scene = data / room, work / f"{room}_{kind}.r2s"
    cameras = folder / "cameras.json"
    height_m = json.loads(cameras.read_text())["captures"][0]["world_from_camera"][2][3]
    if not scene.exists():
        given = ["--poses", str(cameras), "--camera-height", str(height_m)]
        run_r2sego("new", scene, "--captures", str(folder / "photographs"), *given)
        if kind == "recorded":
            maps, rng = work / f"{room}_maps", np.random.default_rng(0)
            maps.mkdir(exist_ok=True)
            for view in load_ground_truth(cameras.parent).views:
                np.save(maps / f"{Path(view.name).stem}.npy", disturbed(view.depth, ALL, error, rng))
            run_r2sego("estimate-depth", scene, "--recorded", maps)
    run_r2sego("refine", scene, "--preset", preset)
    run_r2sego("evaluate", scene, "--frozen", cameras)
    opened = Scene.open(scene)
    arms = json.loads(opened.metrics_file.read_text())["arms"]
    true = true_depths(opened, cameras)
    heights_m = floor_heights_m(opened, true)
    last = opened.read(ROLLOUTS.of_round(opened.rounds_done() - 1))
    return {
        "room": room,
        "kind": kind,
        "completed_within_10_percent": within(opened, true, 0.1),
        "completed_within_25_percent": within(opened, true, 0.25),
        "floor_median_cm": round(100.0 * float(np.median(heights_m)), 2),
        "floor_within_5_cm": round(float((np.abs(heights_m) <= 0.05).mean()), 4),
        "rollouts": [sum(one.success for one in last), len(last)],
        "views_kept": [len(opened.read(VIEWS.of_round(index))) for index in range(opened.rounds_done())],
        **{arm: [scored[key] for key in ("psnr", "ssim")] for arm, scored in arms.items()},
    }


def main() -> None:
    """Measure the chosen rooms, one after the other; each prints a line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder of the rooms")
    parser.add_argument("--to", type=Path, required=True, help="folder for the bundles")
    parser.add_argument("--room", action="append", help="default: all")
    parser.add_argument("--kind", action="append", choices=KINDS, help="default: both")
    parser.add_argument("--error", type=float, default=0.05, help="mean relative error of recorded depth")
    parser.add_argument("--preset", default="preview")
    arguments = parser.parse_args()
    arguments.to.mkdir(parents=True, exist_ok=True)
    for room in arguments.room or sorted(file.parent.name for file in arguments.data.glob("*/info.json")):
        for kind in arguments.kind or KINDS:
            figures = measure(arguments.data, arguments.to, room, kind, arguments.error, arguments.preset)
            print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
