"""How good the geometry of a scene with ground truth is, and what it costs.

The pipeline sees photographs and poses alone; the truth is carried into its world frame
afterwards, by the similarity that registration found, and only scored against.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np

from r2sego_blender.bundle import layout
from r2sego_blender.bundle.layout import of_round
from r2sego_blender.bundle.runner import Runner, Step
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import cpu_s, forget_peak_memory, peak_memory_mb, processor
from r2sego_blender.evaluation.ground_truth import GroundTruth, load_ground_truth
from r2sego_blender.geometry.objects.prior_files import PRIOR_RECORDS
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED
from r2sego_blender.geometry.stereo.stereo import DEPTH
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.capture_steps import AlignedPriors, RegisteredCaptures
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.refine.steps import Steps
from r2sego_blender.splats.artifacts import INITIAL_ASSET

from .truth.disturbance import disturbed_captures
from .truth.geometry_scores import depth_score, mesh_score
from .truth.true_objects import TrueObject, declare_true_objects

_PARTS = {
    layout.DEPTH: "stereo",
    layout.INITIAL_ASSET: "initial_asset",
    layout.OBSERVED: "observed",
    layout.PLANES: "planes",
    layout.COMPLETED: "completion",
    layout.BACKDROP: "backdrop",
    layout.PRIORS: "priors",
    of_round(0, "proxy"): "composition",
    of_round(1, "proxy"): "refresh",
}
"""What a step publishes -> its name in the figures."""

_TINY: Mapping[str, Any] = {
    "stereo.max_side_px": 96,
    "stereo.iterations": 1,
    "stereo.geometric_rounds": 1,
    "stereo.geometric_sweeps": 1,
    "proxy.voxel_m": 0.1,
    "proxy.truncation_m": 0.2,
}
"""Settings under which every kernel of the steps is compiled, at little cost."""

_SCORING, _DISTURBANCE, _LIBRARY = 0, 1, 2
"""Streams of random numbers, apart from those of the pipeline."""

T = TypeVar("T")


@dataclass(frozen=True)
class Cost:
    """Seconds on the clock, and of the processor: all threads and ended child processes."""

    wall_s: float
    cpu_s: float


def bench_geometry(
    scene: Path, library: Path | None = None, seed: int = 0, noise: bool = True, progress: Progress = SILENT
) -> dict[str, Any]:
    """Make the geometry of the folder ``scene`` and score it; with ``noise`` also disturbed.

    With ``library``, a scene's file such as a .glb whose meshes are all wrong here, it is made
    once more with shape priors: the true objects' meshes hidden among those (``true_objects``).

    ``scene`` is what ``load_ground_truth`` reads, with its photographs. Everything is made
    in a temporary bundle that is removed. Returns flat JSON-ready figures, shares in [0, 1].
    Raises EvaluationError and CaptureError for the folder, and what the steps raise.
    """
    truth = load_ground_truth(scene)
    with tempfile.TemporaryDirectory(prefix="r2sego-geometry-") as temporary:
        folder = Path(temporary)
        bundle, creation = _costing(lambda: _bundle(folder / "scene.r2s", scene, seed, progress))
        _warm_up(bundle, folder / "warm.r2s")
        forget_peak_memory()
        costs = _run(bundle, progress)
        peak_mb = peak_memory_mb()  # before the arrays of what follows
        figures = {
            "machine": processor(),
            "threads": numba.get_num_threads(),
            "scene": str(scene),
            "captures": len(truth.views),
            "seed": seed,
            "peak_rss_mb": peak_mb,
        }
        figures |= _costs(costs, creation)
        figures |= _stereo_scores(bundle, truth) | _proxy_scores(bundle, truth, seed)
        if library is not None:
            figures |= _with_priors(bundle, truth, library, folder, seed, progress)
        if noise:
            poorer = folder / "disturbed"
            poorer.mkdir()
            disturbed_captures(scene, poorer, np.random.default_rng([seed, _DISTURBANCE]))
            disturbed = _bundle(folder / "disturbed.r2s", poorer, seed, progress)
            runner = _CostedRunner(disturbed)
            refine(disturbed, progress, until=layout.DEPTH, runner=runner)
            scores = {"stereo_wall_s": runner.costs[layout.DEPTH].wall_s} | _stereo_scores(disturbed, truth)
            figures |= {f"noisy_{name}": value for name, value in scores.items()}
    return figures


def _with_priors(
    bundle: Scene, truth: GroundTruth, other_scene: Path, folder: Path, seed: int, progress: Progress
) -> dict[str, Any]:
    """The same scene with objects declared: what became of each, and the proxy's scores."""
    in_world = truth.transformed(_world_from_capture(bundle))
    rng = np.random.default_rng([seed, _LIBRARY])
    objects, wrong = declare_true_objects(bundle, in_world, other_scene, folder / "library", rng)
    figures: dict[str, Any] = {"library_meshes": len(objects) + len(wrong), "objects": len(objects)}
    bundle = bundle.declare(mesh_library=str(folder / "library"))
    costs = _run(bundle, progress)
    figures |= {f"with_priors_{n}": v for n, v in _proxy_scores(bundle, truth, seed).items()}
    figures["alignment_wall_s"], figures["alignment_cpu_s"] = vars(costs[layout.PRIORS]).values()
    figures["with_priors_composition_wall_s"] = costs[of_round(0, "proxy")].wall_s
    figures["with_priors_refresh_wall_s"] = costs[of_round(1, "proxy")].wall_s
    figures["with_priors_peak_rss_mb"] = peak_memory_mb()
    figures |= _alignments(bundle.read(PRIOR_RECORDS), objects, seed)

    for one in objects:
        (folder / "library" / f"{one.name}.ply").unlink()
    bundle = bundle.declare(mesh_library=str(folder / "library"))
    steps = Steps(Runner(bundle), bundle.declaration.settings, progress)
    steps.align_priors(RegisteredCaptures(), OBSERVED, AlignedPriors().planes)
    accepted = [one["name"] for one in bundle.read(PRIOR_RECORDS) if not one["refusal"]]
    pairs = len(objects) * len(wrong)
    return figures | {"wrong_accepted": accepted, "wrong_rejected": 1 - len(accepted) / pairs}


def _alignments(records: list[dict[str, Any]], objects: tuple[TrueObject, ...], seed: int) -> dict[str, Any]:
    """Each object's shape and errors; a twin's mesh is as right as its own."""
    rng = np.random.default_rng([seed, _SCORING])
    figures: dict[str, Any] = {}
    for record in records:
        told = {name: record.get(name) for name in ("refusal", "shape", "energy", "silhouette_iou")}
        true = next(one for one in objects if one.name == record["name"])
        used = next((one for one in objects if one.name == record.get("shape")), None)
        if used is not None and (pose := true.pose_of(used)) is not None:
            told |= vars(replace(used, world_from_own=pose).score(np.array(record["world_from_own"]), rng))
        figures[record["name"]] = told
    return {"alignment": figures}


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    peak = "unknown" if f["peak_rss_mb"] is None else f"{f['peak_rss_mb']:.0f} MB"
    text = [
        f"{f['machine']}, {f['threads']} thread{'s' if f['threads'] > 1 else ''}",
        f"{f['scene']}: {f['captures']} captures",
        "",
        f"{'':<24}{'seconds':>9}{'CPU':>9}",
    ]
    for part in ("creation", *_PARTS.values()):
        text.append(f"{part.replace('_', ' '):<24}{f[f'{part}_wall_s']:>9.1f}{f[f'{part}_cpu_s']:>9.1f}")
    text.append(f"{'captures to proxy':<24}{f['proxy_wall_s']:>9.1f}{f['proxy_cpu_s']:>9.1f}")
    text += ["", _stereo_line("stereo", f)]
    if "noisy_stereo_coverage" in f:
        text.append(_stereo_line("noisy_stereo", f))
    text.append(
        f"proxy: F-score at 5 cm {f['proxy_fscore']:.1%}, precision {f['proxy_precision']:.1%}, "
        f"recall {f['proxy_recall']:.1%}, median error {100 * f['proxy_median_error_m']:.2f} cm"
    )
    if "with_priors_proxy_fscore" in f:
        text.append(
            f"with priors from {f['library_meshes']} meshes: F-score {f['with_priors_proxy_fscore']:.1%}, "
            f"{f['alignment_wall_s']:.1f} s; wrong shapes rejected {f['wrong_rejected']:.1%}"
        )
        text += [_alignment_line(name, told) for name, told in f["alignment"].items()]
    return [*text, f"peak memory {peak}"]


def _alignment_line(name: str, told: Mapping[str, Any]) -> str:
    if told["refusal"]:
        return f"  {name}: refused, {told['refusal']}"
    if "translation_m" not in told:
        return f"  {name}: a wrong shape, {told['shape']}, energy {told['energy']:.2f}"
    return (
        f"  {name}: {100 * told['translation_m']:.2f} cm, {told['rotation_deg']:.2f} deg, "
        f"{told['scale_percent']:.2f} %, energy {told['energy']:.2f}"
    )


def _stereo_line(name: str, f: Mapping[str, Any]) -> str:
    return (
        f"{name.replace('_', ' ')}: {f[f'{name}_coverage']:.1%} of the pixels, "
        f"{f[f'{name}_accuracy']:.1%} of them within 3 %, {f[f'{name}_wall_s']:.1f} s"
    )


class _CostedRunner(Runner):
    """Runs steps and keeps what each cost, its files' digests included."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.costs: dict[str, Cost] = {}

    def do(self, step: Step) -> None:
        _, self.costs[step.target] = _costing(lambda: super(_CostedRunner, self).do(step))


def _bundle(path: Path, captures: Path, seed: int, progress: Progress) -> Scene:
    created = create_scene(path, captures, captures / "cameras.json", progress=progress)
    return created.declare(overrides={"seed": seed})


def _run(bundle: Scene, progress: Progress) -> dict[str, Cost]:
    """What lines 1 to 6 of Algorithm 1 cost, and line 6 once more.

    The second proxy is made of the same asset: what is measured is its rebuilding.
    """
    runner = _CostedRunner(bundle)
    refine(bundle, progress, until=PROXY.of_round(0).name, runner=runner)
    steps = Steps(runner, bundle.declaration.settings, progress)
    steps.geometry_proxy(1, RegisteredCaptures(), OBSERVED, AlignedPriors(), INITIAL_ASSET)
    return runner.costs


def _warm_up(bundle: Scene, path: Path) -> None:
    """Compile the kernels, which is not counted: the same steps on tiny depth maps."""
    shutil.copytree(bundle.path, path)
    with contextlib.suppress(GeometryError):  # so little depth may make no surface
        _run(Scene.open(path).declare(overrides=_TINY), SILENT)


def _costing(work: Callable[[], T]) -> tuple[T, Cost]:
    started_s, used_s = time.perf_counter(), cpu_s()
    result = work()
    return result, Cost(time.perf_counter() - started_s, cpu_s() - used_s)


def _costs(steps: Mapping[str, Cost], creation: Cost) -> dict[str, float]:
    """Every part's seconds; ``proxy`` is all from the captures to the first proxy."""
    parts = {"creation": creation} | {_PARTS[target]: cost for target, cost in steps.items()}
    first = [cost for part, cost in parts.items() if part != "refresh"]
    parts["proxy"] = Cost(sum(cost.wall_s for cost in first), sum(cost.cpu_s for cost in first))
    return {
        f"{part}_{clock}": round(getattr(cost, clock), 3)
        for part, cost in parts.items()
        for clock in ("wall_s", "cpu_s")
    }


def _stereo_scores(bundle: Scene, truth: GroundTruth) -> dict[str, float]:
    """Coverage and accuracy of the reliable depth, over all captures and of each."""
    settings = bundle.declaration.settings.stereo
    true = [view.depth for view in truth.transformed(_world_from_capture(bundle)).views]
    maps = bundle.read(DEPTH).of(bundle.read(CAPTURES))
    found = [np.where(one.reliable(settings), one.depth, np.float32(0.0)) for one in maps]
    scores = {"stereo": depth_score(found, true)}
    for view, depth, true_depth in zip(truth.views, found, true, strict=True):
        scores[f"stereo_{view.name}"] = depth_score([depth], [true_depth])
    return {
        f"{name}_{kind}": getattr(score, kind) for name, score in scores.items() for kind in ("coverage", "accuracy")
    }


def _proxy_scores(bundle: Scene, truth: GroundTruth, seed: int) -> dict[str, float]:
    proxy = bundle.read(PROXY.of_round(0))
    rng = np.random.default_rng([seed, _SCORING])
    score = mesh_score(proxy.vertices, proxy.faces, truth.transformed(_world_from_capture(bundle)), rng)
    return {f"proxy_{name}": value for name, value in vars(score).items()}


def _world_from_capture(bundle: Scene) -> np.ndarray:
    return np.array(bundle.declaration.world_from_capture)
