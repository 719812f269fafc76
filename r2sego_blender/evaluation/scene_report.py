"""The report of a scene, filled from its bundle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..bundle.backends import WITH_RECORDED
from ..bundle.figures import CAMERAS
from ..bundle.layout import REPORT_PAGE, of_round
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..config.presets import entries
from ..generation.conditions.condition_files import load_conditions
from ..generation.view_effects import ViewEffect, effects_of_round
from ..generation.view_records import ViewRecord, read_views
from ..geometry.proxy.proxy import PROXY, GeometryProxy, Provenance
from ..results.status import robot_in_use, scores_hold, without_folders
from ..robot.rollouts.rollout import ROLLOUTS
from ..views.selection import SELECTION, Selection
from . import view_influence
from .arms import ARMS, REFINED, strongest_baseline
from .figures import camera_map, depth_picture, top_view
from .frozen import ArmScore
from .report import write_report
from .report_data import (
    Arm,
    Backend,
    CandidateCurves,
    Collision,
    ErrorSplit,
    FrozenView,
    ReportData,
    RolloutSummary,
    Round,
    ScoredRound,
    SettingUsed,
    Target,
)
from .round_scores import RoundScore, below
from .surfaces.figures import geometry_lines, region_psnr, unseen_told
from .surfaces.surface_scores import ArmFigures

_STL_HEADER_BYTES, _STL_FACE_BYTES = 84, 50
"""Of a binary STL, as the collision surface is written."""

_PAPER_BACKENDS = {
    "initial_asset": "feed-forward pointmap-to-Gaussian reconstructor of the DUSt3R/VGGT family",
    "shape_prior": "SAM 3 and SAM 3D",
    "surface": "NKSR",
    "controller": "SONIC/WBC behaviour controller",
    "conditions": "the proxy rendered along the path",
    "generator": "ViewCrafter",
    "registration": "VGGT",
    "splat_trainer": "3DGS on CUDA",
}


def renew_scene_report(scene: Scene, before: Sequence[Mapping[str, Any]]) -> Path:
    """The report after a refinement that began with the journal ``before``; its page.

    It is written anew, without scores, unless nothing was made and the page's scores still hold.
    """
    page = scene.report_folder / REPORT_PAGE
    is_current = page.is_file() and scene.journal() == before and scores_hold(scene)
    return page if is_current else write_scene_report(scene)


def write_scene_report(
    scene: Scene,
    scores: Mapping[str, ArmScore] | None = None,
    frozen: Sequence[FrozenView] = (),
    scored_rounds: Sequence[RoundScore] = (),
    error_split: ErrorSplit | None = None,
    figures: Mapping[str, ArmFigures] = MappingProxyType({}),
    generator: str = "",
    influence: Mapping[str, Any] = MappingProxyType({}),
    frozen_poses: str = "",
    of_before: str = "",
) -> Path:
    """Write ``report/index.html`` from what the bundle holds, with scores where there are some.

    ``influence`` is what generated views did on the frozen ones (``view_influence``), ``frozen_poses`` how their given
    poses were refined, and ``of_before`` that the asset is not of what is declared now.
    """
    declared = scene.declaration
    rounds = [index for index in range(scene.newest_round("asset.ply") + 1) if _is_there(scene, index)]
    last = scene.read(PROXY.of_round(rounds[-1])) if rounds else None
    reasons = [score.lpips_reason for score in (scores or {}).values()]
    refined = figures[REFINED].whole if REFINED in figures else {}
    return write_report(
        scene.made_folder(scene.report_folder.name),
        ReportData(
            title=scene.name.removesuffix(".r2s").replace("_", " "),
            about=f"{len(scene.read(CAMERAS)['captures'])} photographs, "
            f"{len(rounds)} refinement round{'s' if len(rounds) != 1 else ''}",
            facts=(
                ("Captures", declared.captures_source),
                ("Ground", declared.ground),
                ("Scale", declared.scale_source),
                ("Robot", without_folders(robot_in_use(scene))),
                ("Behaviour scope", without_folders(declared.scope)),
                ("Preset", declared.preset),
                ("Seed", str(declared.settings.seed)),
                *([("Held-out views", frozen_poses)] if frozen_poses else []),
                *([("Not up to date", of_before)] if of_before else []),
            ),
            arms=tuple(_arm(key, score, figures) for key, score in (scores or {}).items()),
            baseline=strongest_baseline({key: score.psnr for key, score in (scores or {}).items()}),
            lpips_reason=next(iter(reasons), ""),
            generator=generator,
            influence=view_influence.told(influence),
            unseen_told=unseen_told(refined),
            geometry=tuple(geometry_lines(refined)),
            backends=tuple(_backend(slot, name) for slot, name in scene.backends.items()),
            scored_rounds=tuple(
                ScoredRound(one.round, one.psnr, one.ssim, mark, one.missing)
                for one, mark in zip(scored_rounds, below(scored_rounds), strict=True)
            ),
            error_split=error_split,
            frozen=tuple(frozen),
            rounds=tuple(_round(scene, index, influence) for index in rounds),
            provenance={} if last is None else _provenance(last),
            collision=_collision(scene),
            settings=_settings(scene),
            timings=tuple(
                (record["step"], record["seconds"]) for record in _last_records(scene) if "seconds" in record
            ),
        ),
    )


def _is_there(scene: Scene, index: int) -> bool:
    """Whether a round can be shown, be its asset there or not."""
    return (scene.round_folder(index) / "proxy").is_dir()


def _arm(key: str, score: ArmScore, figures: Mapping[str, ArmFigures]) -> Arm:
    whole = figures[key].whole if key in figures else {}
    note = "; ".join(filter(None, [ARMS[key].note, score.backend]))
    regions = {kind: region_psnr(whole, kind) for kind in ("psnr_seen", "psnr_unseen")}
    scores = (score.psnr, score.ssim, score.lpips_alex)
    return Arm(key, ARMS[key].label, *scores, note, **regions, psnr_corrected=score.psnr_corrected)


def _backend(slot: str, name: str) -> Backend:
    return Backend(
        slot.replace("_", " "),
        name,
        learned=slot != "splat_trainer" and not name.startswith("embedded") and name not in WITH_RECORDED.values(),
        paper=_PAPER_BACKENDS.get(slot, ""),
    )


def _provenance(proxy: GeometryProxy) -> dict[str, float]:
    corners = proxy.vertices[proxy.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = max(float(area.sum()), 1e-12)
    usual = (Provenance.OBSERVED, Provenance.PRIOR, Provenance.COMPLETED)
    there = [kind for kind in Provenance if kind in usual or (proxy.provenance == kind).any()]
    return {kind.name.lower(): float(area[proxy.provenance == kind].sum()) / total for kind in there}


def _round(scene: Scene, index: int, influence: Mapping[str, Any]) -> Round:
    proxy = scene.read(PROXY.of_round(index))
    selection, candidates = scene.read(SELECTION.of_round(index))
    poses = np.stack([camera.world_from_camera for camera in candidates])
    captures = scene.read(CAPTURES)
    budget = scene.declaration.settings.selection.target_views
    plan = top_view(proxy)
    views = read_views(scene.path / of_round(index, "views"), budget)
    effects = effects_of_round(scene, index)
    removed = {view["rank"]: view["removed"] for view in influence.get("views", ()) if view["round"] == index}
    return Round(
        number=index,
        rollouts=tuple(
            RolloutSummary(
                seed=rollout.seed[1],
                success=rollout.success,
                reason=" ".join(filter(None, [rollout.behaviour, rollout.reason, rollout.detail])),
                duration_s=float(rollout.times_s[-1]) if len(rollout.times_s) else None,
            )
            for rollout in scene.read(ROLLOUTS.of_round(index))
        ),
        candidates=CandidateCurves(
            selection.deficit, selection.availability, selection.score, selection.rollout, selection.targets
        ),
        targets=tuple(
            _target(view, selection, captures, effects.get(view.rank), removed.get(view.rank)) for view in views
        ),
        proxy_picture=plan.image,
        camera_map=camera_map(
            plan, [c.camera for c in captures], poses, selection.targets, [one.camera for one in selection.photographs]
        ),
        note=selection.note,
    )


def _target(
    view: ViewRecord,
    selection: Selection,
    captures: Sequence[Capture],
    effect: ViewEffect | None,
    removed: float | None,
) -> Target:
    conditions = load_conditions(view.folder / "conditions")
    frame = view.folder / "frame.png"
    photographs = {capture.name: capture.image_path for capture in captures}
    inliers = view.figures.get("inliers")
    return Target(
        name=f"rank {view.rank + 1}, rollout {view.rollout}, frame {view.frame}",
        accepted=view.accepted,
        verdict=view.fate,
        reference_name=view.reference,
        reference=photographs.get(view.reference),
        condition=depth_picture(conditions[-1].depth) if conditions else None,
        generated=frame if frame.is_file() else None,
        score=float(selection.score[view.candidate]),
        inliers=None if inliers is None else int(inliers),
        offset_m=view.figures.get("offset_m"),
        turn_deg=view.figures.get("turn_deg"),
        effect="" if effect is None else str(effect),
        removed=removed,
    )


def _collision(scene: Scene) -> Collision | None:
    mesh_file = scene.collision_folder / "mesh.stl"
    if not mesh_file.is_file():
        return None
    faces = (mesh_file.stat().st_size - _STL_HEADER_BYTES) // _STL_FACE_BYTES
    pieces = len(list((scene.collision_folder / "hulls").glob("*.obj")))
    return Collision(max(faces, 0), pieces)


def _settings(scene: Scene) -> tuple[SettingUsed, ...]:
    used = {entry.key: entry.default for entry in entries(scene.declaration.settings)}
    return tuple(SettingUsed(entry.key, str(used[entry.key]), str(entry.default), entry.doc) for entry in entries())


def _last_records(scene: Scene) -> list[dict[str, Any]]:
    """The last record of every step, in the order they ran first."""
    last: dict[str, dict[str, Any]] = {}
    for record in scene.journal():
        last[record["step"]] = record
    return list(last.values())
