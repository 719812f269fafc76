"""The whole loop on a scene with frozen views: what each round gains, and what each part costs.

The pipeline sees photographs and poses alone. Frozen views score what came out, and with
``library`` the truth stands in for an artist, who would bring masks and a folder of meshes.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numba
import numpy as np

from r2sego_blender.bundle.layout import of_round
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.poses.cameras_json import read_cameras_json
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.presets import with_overrides
from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.json_files import rounded
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.evaluation import round_scores
from r2sego_blender.evaluation.arms import ARMS, DEFAULT_ARMS, REFINED, strongest_baseline
from r2sego_blender.evaluation.ground_truth import load_ground_truth
from r2sego_blender.evaluation.scene_evaluation import evaluate_scene
from r2sego_blender.generation.view_records import read_views
from r2sego_blender.geometry.objects.prior_files import PRIOR_RECORDS
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene

from .truth.true_objects import declare_true_objects

_LIBRARY = 2  # the stream of random numbers that the other benches make their libraries with
_REPORT = "report/"  # what evaluating publishes: the baseline
_SAME_PLACE_M = 0.1


def bench_refinement(
    scene: Path,
    bundle: Path | None = None,
    library: Path | None = None,
    preset: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Refine the captures of the folder ``scene``, and score it on the folder's frozen views.

    ``scene`` holds photographs and a cameras.json with a frozen list. The bundle is made at
    ``bundle`` and stays there; one that is there already goes on where it stopped. Without it
    the bundle is a temporary one. ``preset`` and ``overrides`` are its settings, by default
    those of a new scene or the bundle's own. With ``library``, another scene's .glb, the true
    objects' masks are declared, and their meshes stand among that scene's (``true_objects``);
    the folder must then hold its ground truth too.

    Returns JSON-ready figures. ``seconds`` are those of each part's last run, which for the
    parts in ``made_before`` was an earlier call's; compiling kernels counts where it is done.
    Raises SceneError for a bundle of other captures, CaptureError and EvaluationError for the
    folder, SettingsError, and what the steps raise.
    """
    changes = dict(overrides or {})
    cameras = scene / "cameras.json"
    truth = None if library is None else load_ground_truth(scene)
    with _place(bundle) as path:
        made, creation = _opened(path, scene, changes, progress)
        with made.locked():
            if preset is not None and preset != made.declaration.preset:
                made = made.declare(preset=preset, overrides=changes)
            else:
                made = made.declare(overrides={**made.declaration.overrides, **changes})
            frozen = len(load_frozen_views(cameras))  # before an hour's work: are they there?
            if library is not None and truth is not None:
                # masks and meshes are the same in every call, so that nothing is made twice
                rng = np.random.default_rng([made.declaration.settings.seed, _LIBRARY])
                in_world = truth.transformed(np.array(made.declaration.world_from_capture))
                declare_true_objects(made, in_world, library, path / "library", rng)
                made = made.declare(mesh_library=str((path / "library").resolve()))
            before = len(made.journal())
            refine(made, progress)
            metrics = evaluate_scene(made, cameras, progress)
        h = made.declaration.settings
        return {
            "machine": processor(),
            "threads": numba.get_num_threads(),
            "scene": str(scene),
            "captures": len(made.read(CAPTURES)),
            "frozen": frozen,
            "preset": made.declaration.preset,
            "overrides": dict(made.declaration.overrides),
            "seed": h.seed,
            "objects": _objects(made),
            **_seconds(made, before, creation),
            "views": [_views(made, index) for index in range(h.rounds)],
            **_scores(metrics),
        }


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    used = sum(not refusal for refusal in f["objects"].values())
    text = [
        f"{f['machine']}, {f['threads']} thread{'s' if f['threads'] > 1 else ''}",
        f"{f['scene']}: {f['captures']} captures, {f['frozen']} frozen views, preset {f['preset']}",
        f"{used} of {len(f['objects'])} objects with a shape prior",
        "",
        *(f"{part:<28}{seconds:>9.1f} s" for part, seconds in f["seconds"].items()),
        f"{'refinement':<28}{f['refinement_s']:>9.1f} s",
    ]
    if f["made_before"]:
        text.append(f"{len(f['made_before'])} of these parts were made before")
    text.append("")
    for one in f["views"]:
        text.append(f"round {one['round']}: {one['kept']} frames kept, {one['rejected']} rejected")
        text += [f"  {reason}" for reason in one["reasons"]]
    text += ["", f"{'':<{round_scores.LABEL_WIDTH}}{'PSNR dB':>9}{'SSIM':>8}"]
    for arm in DEFAULT_ARMS:
        text.append(f"{ARMS[arm].label:<{round_scores.LABEL_WIDTH}}{_decibels(f[arm]['psnr'])}{f[arm]['ssim']:>8.3f}")
    text += round_scores.lines(f["rounds"])
    baseline = ARMS[f["strongest_baseline"]].label
    text.append(f"gain over {baseline} {_decibels(f['gain'])} dB; rounds fall: {f['rounds_fall']}")
    return text


@contextlib.contextmanager
def _place(bundle: Path | None) -> Iterator[Path]:
    """Where the bundle is or shall be made; a temporary one goes when it has been used."""
    if bundle is not None:
        yield bundle
        return
    with tempfile.TemporaryDirectory(prefix="r2sego-refinement-") as temporary:
        yield Path(temporary) / "scene.r2s"


def _opened(
    path: Path, scene: Path, overrides: Mapping[str, Any], progress: Progress
) -> tuple[Scene, dict[str, float]]:
    """The bundle at ``path``, made of the folder's captures unless it is there, and its seconds."""
    cameras = scene / "cameras.json"
    if not path.exists():
        started_s = time.perf_counter()
        settings = with_overrides(overrides).captures
        made = create_scene(path, scene, cameras, settings=settings, progress=progress)
        return made, {"creation": round(time.perf_counter() - started_s, 3)}
    made = Scene.open(path)
    world_from_capture = np.array(made.declaration.world_from_capture)
    given = [world_from_capture @ one.world_from_camera[:, 3] for one in read_cameras_json(cameras, scene)[0]]
    stored = [capture.camera.centre for capture in made.read(CAPTURES)]
    apart = [np.linalg.norm(a[:3] - b) for a, b in zip(given, stored, strict=False)]
    if len(given) != len(stored) or max(apart) > _SAME_PLACE_M:
        raise SceneError(
            f"this bundle is not of the captures in {cameras}",
            where=path,
            cure="Name its own scene folder, or another place for a new bundle.",
        )
    return made, {}


def _objects(made: Scene) -> dict[str, str]:
    """Each declared object, and why it has no shape prior; '' where it has one."""
    return {one["name"]: str(one["refusal"]) for one in made.read(PRIOR_RECORDS)}


def _seconds(made: Scene, before: int, creation: Mapping[str, float]) -> dict[str, Any]:
    """The seconds of every part, by its name in the bundle, and of the refinement in all."""
    journal, rounds = made.journal(), made.declaration.settings.rounds
    parts = dict(creation) | {record["step"]: record["seconds"] for record in journal}
    parts = {part: seconds for part, seconds in parts.items() if _round_of(part) < rounds}
    fresh = {record["step"] for record in journal[before:]} | creation.keys()
    refinement_s = sum(seconds for part, seconds in parts.items() if not part.startswith(_REPORT))
    return {
        "seconds": parts,
        "made_before": [part for part in parts if part not in fresh],
        "refinement_s": round(refinement_s, 3),
    }


def _round_of(part: str) -> int:
    """The round that publishes a part, -1 for what is of none."""
    head, _, rest = part.partition("/")
    return int(rest.partition("/")[0]) if head == "rounds" else -1


def _views(made: Scene, round_index: int) -> dict[str, Any]:
    """How many generated frames of a round were kept, and why the others were not."""
    h = made.declaration.settings
    views = read_views(made.path / of_round(round_index, "views"), h.selection.target_views)
    reasons = [view.fate for view in views if not view.accepted]
    return {"round": round_index, "kept": len(views) - len(reasons), "rejected": len(reasons), "reasons": reasons}


def _scores(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """The arms, the rounds and what follows from them, of a ``metrics.json``."""
    arms = {arm: {kind: metrics["arms"][arm][kind] for kind in ("psnr", "ssim")} for arm in DEFAULT_ARMS}
    strongest = strongest_baseline({arm: scored["psnr"] for arm, scored in arms.items()})
    refined, baseline = arms[REFINED]["psnr"], arms[strongest]["psnr"]
    gain = None if refined is None or baseline is None else rounded(refined - baseline)
    return {
        **arms,
        "strongest_baseline": strongest,
        "gain": gain,
        "rounds": metrics["rounds"],
        "rounds_fall": any("mark" in one for one in metrics["rounds"]),
        "causes": metrics["causes"],
    }


def _decibels(value: float | None) -> str:
    return f"{'equal' if value is None else f'{value:.2f}':>9}"
