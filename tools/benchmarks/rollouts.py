"""What the robot proxy costs here: successful rollouts of a scope, and the scoring of their views."""

from __future__ import annotations

import multiprocessing
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np

from r2sego_blender.bundle.creating import create_bundle
from r2sego_blender.bundle.declaration import Declaration
from r2sego_blender.bundle.layout import of_round
from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.commands.bench_defaults import ROLLOUTS_CANDIDATES
from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.errors import RobotError, SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import available_cores, cpu_s, processor
from r2sego_blender.geometry.collision.collision_files import COLLISION, write_collision
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.capture_steps import AlignedPriors, RegisteredCaptures
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.refine.steps import Steps
from r2sego_blender.robot.rollouts.rollout import Rollout
from r2sego_blender.robot.scope.scope import BehaviourScope
from r2sego_blender.splats.artifacts import INITIAL_ASSET
from r2sego_blender.views.scoring.scores import support_scores

from .workloads import made_up_collision, made_up_path, made_up_proxy, made_up_room

SCOPES = ("walk_and_look", "sit_down")
GAUSSIANS, TRIANGLES = 100_000, 200_000

_SIZE = (640, 480)
_IDENTITY = tuple(map(tuple, np.eye(4).tolist()))
_CAPTURES = 6
_PROXY, _COLLISION = of_round(0, "proxy"), of_round(0, "collision")
_ENDED_S = 30.0
"""Processes with an attempt that is no longer needed end within this."""

T = TypeVar("T")


def bench_rollouts(
    scene: Path | None = None,
    robot: str | None = None,
    scopes: Sequence[str] = SCOPES,
    seed: int = 0,
    candidates: int = ROLLOUTS_CANDIDATES,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Roll every scope out in ``scene``, and score ``candidates`` views of a made-up room.

    ``scene`` is a bundle with a geometry proxy, a folder with photographs and cameras.json,
    or None for a made-up room; it is copied and left as it is. ``robot`` and ``scopes`` are
    as ``r2sego new`` takes them; the robot is the bundle's own if it is not given. Returns
    JSON-ready figures, docs/selection.md says what each means; a scope that cannot be
    rolled out here has its error among them. Raises SettingsError for a bundle without a
    collision surface, and what making one raises.
    """
    figures: dict[str, Any] = {
        "machine": processor(),
        "cores": available_cores(),
        "threads": numba.get_num_threads(),
        "scene": "made-up room" if scene is None else str(scene),
        "seed": seed,
        "scopes": {},
    }
    with tempfile.TemporaryDirectory(prefix="r2sego-rollouts-") as temporary:
        bundle = _bundle(scene, Path(temporary) / "scene.r2s", robot, progress)
        for scope in scopes:
            figures["scopes"][scope] = _rolled_out(bundle, scope, seed, progress)
    return figures | {"scoring": _scored(candidates, progress)}


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f, s = figures, figures["scoring"]
    text = [f"{f['machine']}, {f['cores']} cores", f"{f['scene']}"]
    for scope, figures_of_scope in f["scopes"].items():
        text += ["", f"{scope}: {_summary(figures_of_scope)}", *_details(figures_of_scope)]
    work = f"{s['candidates']} candidates at {s['size']}, {s['gaussians']} Gaussians, {s['triangles']} triangles"
    return [*text, "", f"scoring {work}: {s['wall_s']:.1f} s ({s['cpu_s']:.1f} s CPU)"]


def _summary(s: dict[str, Any]) -> str:
    if "error" in s:
        return str(s["error"])
    seconds = f"{s['wall_s']:.1f} s ({s['cpu_s']:.1f} s CPU)"
    by = f"{s['robot']} by {s['controller']}"
    return f"{s['succeeded']} rollouts of {s['attempts']} attempts in {seconds}, {by}"


def _details(s: dict[str, Any]) -> list[str]:
    if "error" in s:
        return []
    failed = ", ".join(f"{count} {reason}" for reason, count in s["failures"].items()) or "none"
    (low_m, high_m), (low_deg, high_deg) = s["camera_height_m"], s["camera_pitch_deg"]
    text = [
        f"  failed: {failed}",
        f"  camera {low_m:.2f} to {high_m:.2f} m high, {low_deg:.0f} to {high_deg:.0f} degrees down",
        f"  a foot in stance slid {100.0 * s['foot_slide_m']:.1f} cm at most",
        f"  deepest contact {1000.0 * s['penetration_m']:.1f} mm, helping force {s['assist_n']:.0f} N",
    ]
    return text if s["seated_s"] is None else [*text, f"  seated for {s['seated_s']:.1f} s at least"]


def _bundle(scene: Path | None, place: Path, robot: str | None, progress: Progress) -> Scene:
    """A bundle of the benchmark's own with a proxy and a collision surface in its round 0."""
    if scene is None:
        made = made_up_bundle(place)
    elif (scene / "scene.toml").is_file():
        made = _copied(Scene.open(scene), place)
    else:
        made = create_scene(place, scene, scene / "cameras.json", progress=progress)
        refine(made, progress, until=COLLISION.of_round(0).name)
    declaration = made.declaration if robot is None else replace(made.declaration, robot=robot)
    return Scene(made.path, declaration)


def _copied(scene: Scene, place: Path) -> Scene:
    """What rollouts read of a bundle: those of its newest round become round 0."""
    rounds = scene.declaration.settings.rounds
    has_surface = [k for k in range(rounds) if (scene.round_folder(k) / "collision" / "scene.xml").is_file()]
    if not has_surface:
        raise SettingsError(
            "the bundle has no collision surface yet", where=scene.path, cure="Run `r2sego refine` first."
        )
    for name in ("captures", "geometry/priors"):
        if (scene.path / name).is_dir():
            shutil.copytree(scene.path / name, place / name)
    for name in ("proxy", "collision"):
        shutil.copytree(scene.round_folder(has_surface[-1]) / name, place / of_round(0, name))
    return Scene(place, scene.declaration)


def made_up_bundle(place: Path) -> Scene:
    """The made-up room with captures from its middle; what they show does not matter."""
    lens = made_up_room(0, _SIZE).views[0].camera.scaled(0.1)

    def fill(folder: Path) -> None:
        picture = folder / "grey.png"
        save_image(picture, np.full((*lens.shape, 3), 0.5, np.float32))
        views = enumerate(made_up_path(lens, _CAPTURES))
        save_captures(folder / "captures", [Capture(f"{k}.png", picture, camera) for k, camera in views])
        picture.unlink()
        (folder / _PROXY).mkdir(parents=True)
        (folder / _COLLISION).mkdir()
        made_up_proxy(TRIANGLES // 10).save(folder / _PROXY / "proxy.npz")
        write_collision(made_up_collision(), folder / _COLLISION)

    return create_bundle(place, Declaration("made up", _IDENTITY, "made up", "made up"), fill)


def _rolled_out(bundle: Scene, scope: str, seed: int, progress: Progress) -> dict[str, Any]:
    """The figures of a scope's rollouts; ``error`` alone where there are none."""
    scene = Scene(bundle.path, replace(bundle.declaration, scope=scope))
    step = Steps(Runner(scene), replace(scene.declaration.settings, seed=seed), progress)
    try:
        made, costs = _costing(
            lambda: step.successful_ego_poses(
                0, RegisteredCaptures(), AlignedPriors(), PROXY.of_round(0), COLLISION.of_round(0), INITIAL_ASSET
            )
        )
    except RobotError as error:
        return {"error": str(error)}
    robot, _ = BehaviourScope.load(scope).robot_for(scene.declaration.robot)
    return {"robot": robot} | costs | quality_figures(scene.read(made))


def quality_figures(rollouts: Sequence[Rollout]) -> dict[str, Any]:
    """Attempts and failures; of the successes the extremes, ``assist_n`` their mean.

    ``seated_s`` is the shortest rest of those that sat down, None where none did.
    """
    succeeded = [rollout for rollout in rollouts if rollout.success]
    qualities = [rollout.quality for rollout in succeeded]
    seated_s = [quality.seated_s for quality in qualities if quality.seated_s > 0.0]
    heights_m, pitches_deg = (
        np.array([getattr(quality, name) for quality in qualities]) for name in ("camera_height_m", "camera_pitch_deg")
    )
    return {
        "controller": succeeded[0].controller,
        "attempts": len(rollouts),
        "succeeded": len(succeeded),
        "failures": dict(Counter(rollout.reason for rollout in rollouts if not rollout.success)),
        "behaviours": dict(Counter(rollout.behaviour for rollout in succeeded)),
        "candidates": sum(len(rollout.camera_poses) for rollout in succeeded),
        "camera_height_m": [float(heights_m.min()), float(heights_m.max())],
        "camera_pitch_deg": [float(pitches_deg.min()), float(pitches_deg.max())],
        "foot_slide_m": max(quality.foot_slide_m for quality in qualities),
        "penetration_m": max(quality.penetration_m for quality in qualities),
        "seated_s": min(seated_s, default=None),
        "assist_n": float(np.mean([quality.assist_n for quality in qualities])),
    }


def _scored(candidates: int, progress: Progress) -> dict[str, Any]:
    """The figures of scoring, after the kernels were compiled on a few views."""
    workload = made_up_room(GAUSSIANS, _SIZE)
    proxy, settings = made_up_proxy(TRIANGLES), SelectionSettings()
    views = made_up_path(workload.views[0].camera, candidates)
    support_scores(views[:2], workload.asset, proxy, settings)
    (deficit, availability), costs = _costing(lambda: support_scores(views, workload.asset, proxy, settings, progress))
    return costs | {
        "candidates": len(views),
        "gaussians": len(workload.asset),
        "triangles": len(proxy.faces),
        "size": "{}x{}".format(*_SIZE),
        "scoring_scale": settings.scoring_scale,
        "mean_deficit": float(deficit.mean()),
        "mean_availability": float(availability.mean()),
    }


def _costing(work: Callable[[], T]) -> tuple[T, dict[str, float]]:
    """What ``work`` returns, and its seconds; the CPU's are of all processes it started too."""
    started_s, started_cpu_s = time.perf_counter(), cpu_s()
    result = work()
    wall_s = time.perf_counter() - started_s
    for process in multiprocessing.active_children():
        process.join(_ENDED_S)
    return result, {"wall_s": wall_s, "cpu_s": cpu_s() - started_cpu_s}
