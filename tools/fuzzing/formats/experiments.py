"""What an experiment reads: its plan, what was fixed before, the records of its cells, and their lists of pictures."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.core.progress import SILENT

from ..harness import Harness
from ..seeds import of_tests

_PLAN = """counts = [3, 6]
seeds = [0, 1]
arms = ["vanilla_3dgs", "refined"]
threads = 2

[[scenes]]
name = "room"
captures = "photographs"
poses = "cameras.json"
frozen = "cameras.json"
overrides = {captures.max_side_px = 320}

[[presets]]
preset = "preview"
name = "short"
overrides = {rounds = 1, "training.steps_per_round" = 90}
"""


def _plan(folder: Path) -> None:
    (folder / "plan.toml").write_text(_PLAN, encoding="utf-8")


def _read_plan(folder: Path) -> Any:
    from r2sego_blender.experiments.plan import Plan

    plan = Plan.load(folder / "plan.toml")
    return plan.counts, plan.seeds, plan.arms, [one.settings(plan.seeds[0]) for one in plan.presets]


def _record(folder: Path) -> None:
    from r2sego_blender.experiments.records import Record, Stage

    views = [
        {"name": "frozen_00", "psnr": 24.5, "ssim": 0.81, "psnr_seen": 26.0},
        {"name": "frozen_01", "psnr": None, "ssim": 1.0},
    ]
    regions = {"psnr_seen": 27.5, "psnr_unseen": None, "unseen": 0.25, "seen_by": "the true room's mesh"}
    scored = {"psnr": 25.0, "ssim": 0.8, "lpips_alex": 0.2, **regions, "depth_error": 0.01, "views": views}
    stages = (Stage("refine", 10.5, 9.25, 800.0), Stage("evaluate", 3.0, None, None))
    made_by = {"version": "0.1.0", "system": "Linux x86_64"}
    Record("0" * 64, {"refined": scored}, {"asset.ply": "1" * 64}, stages, {"asset.ply": 2.5}, made_by, 1.75e9).write(
        folder
    )


def _read_record(folder: Path) -> Any:
    from r2sego_blender.experiments.records import read_record

    record = read_record(folder)
    return record, record and (record.seconds, record.peak_mb)


def _inputs(folder: Path) -> None:
    from r2sego_blender import __version__
    from r2sego_blender.core.json_files import write_json

    room = {"captures": [["a.png", "2" * 64]], "poses": "", "frozen": [["b.png", "3" * 64]], "frozen_sha256": "4" * 64}
    write_json(folder / "inputs.json", {"version": __version__, "scenes": {"room": {**room, "options": {"scope": ""}}}})


def _read_inputs(folder: Path) -> Any:
    from r2sego_blender.experiments.inputs import known_inputs

    return known_inputs(folder / "inputs.json")


def _lists(folder: Path) -> None:
    of_tests("dataset_folders").colmap_split(folder, (1, 2, 3), (4, 5), "lists")


def _json_lists(folder: Path) -> None:
    of_tests("dataset_folders").colmap_split(folder, (1, 2, 3), (4, 5), "json")


def _read_split(folder: Path) -> Any:
    from r2sego_blender.captures.poses.photographs import posed_captures
    from r2sego_blender.experiments.datasets.colmap_split import read_split

    return [posed_captures(part, 64) for part in read_split(folder, SILENT)]


def _scannetpp(folder: Path) -> None:
    of_tests("dataset_folders").scannetpp(folder)


def _read_scannetpp(folder: Path) -> Any:
    from r2sego_blender.captures.poses.photographs import posed_captures
    from r2sego_blender.experiments.datasets.sets.scannetpp import split

    found = split(folder, "room", 3, SILENT)
    return found.protocol, [posed_captures(part, 64) for part in (found.captures, found.frozen)]


def _staged(folder: Path) -> None:
    from r2sego_blender.experiments.datasets.sets.seven_scenes import split
    from r2sego_blender.experiments.staging import staged

    scene = of_tests("dataset_folders").seven_scenes(folder / "data", frames=2)
    staged(split(scene, "data", 3, SILENT), "data", folder / "staged")


def _read_staged(folder: Path) -> Any:
    from r2sego_blender.experiments.datasets.sets.seven_scenes import split
    from r2sego_blender.experiments.staging import staged

    return staged(split(folder / "data", "data", 3, SILENT), "data", folder / "staged").name


def _read_depth(folder: Path) -> Any:
    from r2sego_blender.core.arrays import load_array
    from r2sego_blender.experiments.datasets.sets.seven_scenes import split
    from r2sego_blender.experiments.staging import staged

    shutil.rmtree(folder / "with", ignore_errors=True)  # one that is there is kept
    staged(split(folder / "data", "data", 3, SILENT), "data", folder / "with", sensor_depth=True)
    return [load_array(file) for file in sorted((folder / "with/depth").iterdir())]


def _pictures(folder: Path) -> None:
    from r2sego_blender.core.json_files import write_json

    arms = {"vanilla_3dgs": "frozen-a-vanilla-3dgs.jpg", "refined": ""}
    write_json(folder / "frozen.json", {"a.png": {"truth": "a-truth.jpg", "arms": arms, "unseen": "a-unseen.png"}})


def _read_pictures(folder: Path) -> Any:
    from r2sego_blender.evaluation.frozen_pictures import read_frozen_pictures

    return read_frozen_pictures(folder / "frozen.json")


def _external_views(folder: Path) -> None:
    from r2sego_blender.evaluation.external_arms.external_views import ExternalViews

    rng = np.random.default_rng(4)
    pictures = {name: rng.integers(0, 256, (6, 8, 3)) / np.float32(255.0) for name in ("a.png", "b.png")}
    ExternalViews("a model 1.0", "5" * 64, pictures).save(folder / "views.npz")


def _read_external_views(folder: Path) -> Any:
    from r2sego_blender.evaluation.external_arms.external_views import ExternalViews

    views = ExternalViews.load(folder / "views.npz")
    return views.told, dict(views.pictures)


HARNESSES = (
    Harness("report/external_views.npz", _external_views, "views.npz", "npz", _read_external_views),
    Harness("experiments/plan.toml", _plan, "plan.toml", "toml", _read_plan),
    Harness("experiments/record.json", _record, "record.json", "json", _read_record),
    Harness("report/frozen.json", _pictures, "frozen.json", "json", _read_pictures),
    Harness("experiments/inputs.json", _inputs, "inputs.json", "json", _read_inputs),
    Harness("experiments/train.txt", _lists, "train.txt", "text", _read_split, share=0.03),
    Harness("experiments/train_test_lists.json", _json_lists, "train_test_lists.json", "json", _read_split, share=0.03),
    Harness("experiments/scannetpp.json", _scannetpp, "dslr/nerfstudio/transforms.json", "json", _read_scannetpp),
    Harness("experiments/staged.json", _staged, "staged/cameras.json", "json", _read_staged),
    Harness("experiments/depth.png", _staged, "data/seq-01/frame-000000.depth.png", "png", _read_depth, share=0.3),
)
