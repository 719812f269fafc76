"""How good must an estimate of depth be? A scene's true depth, disturbed, recorded as a model's would be.

    python demo/make_truth.py build/demo_truth
    python -m tools.studies.estimated_depth --scene ../shared/scenes/room_a --scene build/demo_truth --to build/study
    python -m tools.studies.estimated_depth --to build/study --write

Each scene is a folder with photographs, a cameras.json and ground truth as ``load_ground_truth`` reads it. Its bundle
is made without estimates; for every kind and size of disturbance a copy, stereo done, gets the disturbed maps as
``r2sego estimate-depth --recorded`` takes them, and goes on to the first proxy; with ``--until views`` to the refined
asset where all kinds come together, which takes minutes a point. Truth enters nothing else; frozen views only score.
What is measured stands in ``--to`` as JSON and is not measured again, and what was cut off goes on where it stopped;
``--write`` makes the page's tables and figure.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle.layout import mask_stems
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.errors import GeometryError, R2SEgoError
from r2sego_blender.core.json_files import read_json, write_json
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.editing.recorded_depth import record_depth
from r2sego_blender.evaluation.ground_truth import GroundTruth, load_ground_truth
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.geometry.room.completed_depth import COMPLETED
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.splats.artifacts import REFINED_ASSET

from .disturbed_depth import ALL, KINDS, disturbed
from .estimated_depth_page import line, write_page
from .scores import depth_scores, given_scores, proxy_scores, view_scores

ERRORS = (0.0, 0.02, 0.05, 0.1, 0.2)
NONE = "none"
STAGES = ("completed", "proxy", "views")
"""What is scored, one after the other: completed depth, the first proxy, the refined asset on frozen views."""

_UNTIL = dict(zip(STAGES, (COMPLETED.name, PROXY.of_round(0).name, REFINED_ASSET.name), strict=True))
_AFTER_STEREO = ("rounds", "report", "collision", "asset.ply")
"""What a copy of a bundle leaves behind."""


@dataclass(frozen=True)
class Point:
    """A ``kind`` of disturbance, ``NONE`` without an estimate, its mean relative ``error`` and its ``seed``."""

    kind: str
    error: float = 0.0
    seed: int = 0

    @property
    def name(self) -> str:
        """What its figures are called."""
        return self.kind if self.kind == NONE else f"{self.kind}_{self.error:g}_{self.seed}"


def points(kinds: Sequence[str], errors: Sequence[float], seeds: int) -> tuple[Point, ...]:
    """No estimate first, then every kind at every size; of no error there is one, all kinds together."""
    disturbances = [
        Point(kind, error, seed)
        for kind in kinds
        for error in errors
        for seed in range(seeds if error > 0.0 else 1)
        if error > 0.0 or kind == ALL
    ]
    return (Point(NONE), *disturbances)


def measure(
    scene: Path,
    to: Path,
    point: Point,
    last: str = "proxy",
    keep: Callable[[dict[str, Any]], object] = lambda figures: None,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """The figures of one point on the folder ``scene`` up to the ``last`` of ``STAGES``; ``keep`` gets them after each.

    Its bundle stands in ``to`` while it is worked on. Where too little is known to go on the figures are why, as
    ``refused``. Raises EvaluationError and CaptureError for the folder, and what else the steps raise.
    """
    truth = load_ground_truth(scene)
    base = _without(scene, to / f"{scene.name}.r2s", progress)
    bundle = base if point.kind == NONE else _copied(base, to / f"{scene.name}_{point.name}.r2s")
    figures: dict[str, Any] = {
        "scene": scene.name,
        **vars(point),
        "made": f"{datetime.date.today().isoformat()}, {processor()}, {os.cpu_count()} cores",
    }
    if point.kind != NONE:
        figures["given"] = _record(bundle, truth, point)
    scores: dict[str, Callable[[], dict[str, Any]]] = {
        "completed": lambda: depth_scores(bundle, truth, base),
        "proxy": lambda: {"proxy": proxy_scores(bundle, truth)},
        "views": lambda: {"views": view_scores(bundle, scene / "cameras.json")},
    }
    try:
        for stage in STAGES[: STAGES.index(last) + 1]:
            refine(bundle, progress, until=_UNTIL[stage])
            figures |= scores[stage]()
            keep(figures)
    except GeometryError as error:
        figures["refused"] = str(error)
        keep(figures)
    if bundle is not base:
        shutil.rmtree(bundle.path)
    return figures


def _without(scene: Path, path: Path, progress: Progress) -> Scene:
    """The bundle of a scene without estimates, up to the first proxy or as far as it goes."""
    if not path.exists():
        create_scene(path, scene, scene / "cameras.json", progress=progress).declare(preset="preview")
    bundle = Scene.open(path)
    with contextlib.suppress(GeometryError):
        refine(bundle, progress, until=PROXY.of_round(0).name)
    return bundle


def _copied(base: Scene, path: Path) -> Scene:
    """The bundle at ``path``, a copy of ``base`` with its stereo if it is not there yet."""
    if not path.exists():
        begun = path.with_suffix(".partial")
        shutil.rmtree(begun, ignore_errors=True)
        shutil.copytree(base.path, begun, ignore=shutil.ignore_patterns(*_AFTER_STEREO))
        begun.rename(path)
    return Scene.open(path)


def _record(bundle: Scene, truth: GroundTruth, point: Point) -> dict[str, float]:
    """Take the disturbed maps into ``bundle``, and score them as tables of models do."""
    captures = bundle.read(CAPTURES)
    stems = mask_stems([capture.name for capture in captures])
    depths = [
        disturbed(view.depth, point.kind, point.error, np.random.default_rng([point.seed, index]))
        for index, view in enumerate(truth.views)
    ]
    with tempfile.TemporaryDirectory(prefix="r2sego-study-") as temporary:
        for capture, depth in zip(captures, depths, strict=True):
            np.save(Path(temporary) / f"{stems[capture.name]}.npy", depth)
        record_depth(bundle, Path(temporary))
    return given_scores(depths, [view.depth for view in truth.views])


def main() -> None:
    """Read the command line, measure what is missing, and write the page where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", type=Path, action="append", default=[], help="a folder with ground truth")
    parser.add_argument("--to", type=Path, required=True, help="folder for bundles and figures")
    parser.add_argument("--errors", type=_numbers, default=ERRORS, help="mean relative errors, such as 0,0.05")
    parser.add_argument("--kinds", type=_kinds, default=KINDS, help=f"of {','.join(KINDS)}")
    parser.add_argument("--seeds", type=int, default=1, help="how many disturbances of each kind and size")
    parser.add_argument("--until", choices=STAGES, default="proxy", help="'views' only where all kinds come together")
    parser.add_argument("--write", action="store_true", help="write docs/estimated-depth.md's table and figure")
    options = parser.parse_args()
    options.to.mkdir(parents=True, exist_ok=True)
    asked = points(options.kinds, options.errors, options.seeds)
    try:
        for scene in options.scene:
            for point in sorted(asked, key=lambda point: point.kind not in (NONE, ALL)):  # what costs most comes first
                file = options.to / f"{scene.name}_{point.name}.json"
                alone = point.kind not in (NONE, ALL) or point.seed > 0
                last = "proxy" if alone and options.until == "views" else options.until
                if not file.exists() or not {last, "refused"} & set(read_json(file)):
                    print(line(measure(scene, options.to, point, last, partial(write_json, file))), flush=True)
    except R2SEgoError as error:
        sys.exit(str(error))
    if options.write:
        write_page([read_json(file) for file in sorted(options.to.glob("*.json"))])


def _numbers(text: str) -> tuple[float, ...]:
    numbers = tuple(float(word) for word in text.split(","))
    if not all(0.0 <= one < 1.0 for one in numbers):
        raise argparse.ArgumentTypeError("mean relative errors lie from 0 to less than 1")
    return numbers


def _kinds(text: str) -> tuple[str, ...]:
    kinds = tuple(text.split(","))
    if unknown := set(kinds) - set(KINDS):
        raise argparse.ArgumentTypeError(f"there is no {', '.join(unknown)}, but {', '.join(KINDS)}")
    return kinds


if __name__ == "__main__":
    main()
