"""What a round of a bundle holds: its proxy, rollouts, selection and generated views."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle import figures
from r2sego_blender.bundle.scene import Scene

from ..harness import Harness
from ..seeds import NAMES, camera, photographs
from .bundles import BUNDLE, build

_ROUND = f"{BUNDLE}/rounds/0"


def _of(kind: str, name: str, file: str, read: Callable[[Path], Any]) -> Harness:
    return Harness(f"round/{name}", build, f"{_ROUND}/{file}", kind, read)


def _scene(folder: Path) -> Scene:
    return Scene.open(folder / BUNDLE)


def _proxy(folder: Path) -> Any:
    from r2sego_blender.geometry.proxy.proxy import PROXY

    return _scene(folder).read(PROXY.of_round(0))


def _coverage(folder: Path) -> Any:
    from r2sego_blender.geometry.visibility.coverage import COVERAGE

    coverage = _scene(folder).read(COVERAGE.of_round(0))
    return coverage, coverage.areas_m2()


def _rollouts(folder: Path) -> Any:
    from r2sego_blender.robot.rollouts.rollout import ROLLOUTS

    return _scene(folder).read(ROLLOUTS.of_round(0))


def _attempts(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.rollout_list import attempts

    return attempts(Bundle.open(folder / BUNDLE), 0)


def _bodies(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.rollout_bodies import RobotBodies

    bodies = RobotBodies.load(Bundle.open(folder / BUNDLE), 0)
    for _, faces, _ in bodies.shapes:
        np.asarray(faces)
    return bodies, bodies.poses(0), {"world_from_body": bodies.poses(0)}


def _selection(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle

    return Bundle.open(folder / BUNDLE).candidates(0)


def _scores(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.view_scores import RoundScores

    scores = RoundScores.read(Bundle.open(folder / BUNDLE), 0)
    return scores, scores and scores.ranked


def _views(folder: Path) -> Any:
    """As they are listed, and as training takes them."""
    from r2sego_blender.generation.ego_views import VIEWS
    from r2sego_blender.generation.view_records import read_views

    return read_views(folder / _ROUND / "views", 3), _scene(folder).read(VIEWS.of_round(0))


def _path(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle

    return Bundle.open(folder / BUNDLE).camera_path(0, 0)


def _counts(folder: Path) -> Any:
    return _scene(folder).read(figures.COUNTS.of_round(0))


def _with_decision(folder: Path) -> None:
    from r2sego_blender.generation.decisions import save_decision

    build(folder)
    save_decision(folder / _ROUND / "views/000", True)


def _conditions(folder: Path) -> None:
    from r2sego_blender.generation.conditions.condition_files import save_conditions
    from r2sego_blender.generation.conditions.conditions import Condition

    lens = camera()
    depth = np.full(lens.shape, 2.0, np.float32)
    normal = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (*lens.shape, 3))
    kinds = (depth > 0).astype(np.uint8)
    save_conditions(folder / "conditions", [Condition(lens, depth, normal, kinds, depth / 2, kinds.astype(np.int32))])


def _read_conditions(folder: Path) -> Any:
    from r2sego_blender.generation.conditions.condition_files import load_conditions

    return load_conditions(folder / "conditions")


def _truth(folder: Path) -> None:
    listed = [{"file": name, **camera(number).to_json()} for number, name in enumerate(NAMES)]
    (folder / "cameras.json").write_text(json.dumps({"frozen": listed}))
    photographs(folder)


def _nearest_truth(folder: Path) -> Any:
    from r2sego_blender.results.panels.view_parts import nearest_truth

    return nearest_truth(folder / "cameras.json", np.eye(4), camera().world_from_camera)


HARNESSES = (
    Harness("round/nearest-truth.json", _truth, "cameras.json", "json", _nearest_truth),
    _of("npz", "proxy.npz", "proxy/proxy.npz", _proxy),
    _of("npz", "coverage.npz", "coverage/coverage.npz", _coverage),
    _of("npz", "rollouts.npz", "rollouts/rollouts.npz", _rollouts),
    _of("json", "rollouts.json", "rollouts/rollouts.json", _rollouts),
    _of("json", "listed-rollouts.json", "rollouts/rollouts.json", _attempts),
    _of("json", "bodies.json", "bodies/bodies.json", _bodies),
    _of("npz", "shapes.npz", "bodies/shapes.npz", _bodies),
    _of("npz", "poses.npz", "bodies/poses.npz", _bodies),
    _of("npz", "selection.npz", "selection/selection.npz", _selection),
    _of("json", "selection.json", "selection/selection.json", _scores),
    _of("npz", "candidates.npz", "selection/candidates.npz", _selection),
    _of("json", "candidates.json", "selection/candidates.json", _selection),
    _of("json", "pose.json", "views/000/pose.json", _views),
    _of("json", "path.json", "views/000/path.json", _path),
    _of("png", "frame.png", "views/000/frame.png", _views),
    _of("json", "metrics.json", "metrics.json", _counts),
    Harness("round/decision.json", _with_decision, f"{_ROUND}/views/000/decision.json", "json", _views),
    Harness("round/conditions.exr", _conditions, "conditions/000.exr", "bytes", _read_conditions),
)
