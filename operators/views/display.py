"""Keeps the frusta in the view, and what is remembered of the scores, in step with the bundle."""

import bpy

from ...r2sego_blender.bridge.views.show_candidates import (
    mark_candidate,
    recolour_candidates,
    show_candidates,
    shown_candidates,
)
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.view_scores import RoundScores, remember, remembered_in
from .. import state


def show(scene: bpy.types.Scene, bundle: Bundle) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Show the candidates as the properties ask; see ``show_candidates``."""
    group = scene.r2sego_views
    swarm, targets = show_candidates(
        scene, bundle, scene.r2sego.round_index, frustum_m=group.frustum_size, shown=group.shown.lower(),
        colour_by=group.colour_by.lower(),
    )  # fmt: skip
    scores = remembered_in(scene)
    if scores is not None:
        swarm["stamp"] = scores.stamp
        mark_candidate(scene, scores.bundle_path, scores.views, group.active, group.frustum_size)
    return swarm, targets


def follow(scene: bpy.types.Scene) -> None:
    """Where frusta are shown, make them those that the properties and the bundle ask for.

    A change of the colour alone is quick. Raises R2SEgoError when the bundle is damaged.
    """
    scores, group = remembered_in(scene), scene.r2sego_views
    swarm = None if scores is None else shown_candidates(scene, scores.bundle_path)
    if swarm is None:
        return
    asked = (scores.stamp, group.shown.lower(), round(group.frustum_size, 6))
    if (swarm.get("stamp"), swarm["shown"], round(swarm["frustum_m"], 6)) != asked:
        show(scene, state.bundle_of(scene))
    else:
        recolour_candidates(swarm, group.colour_by.lower())


def read(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Read the round's scores into what is remembered and into the cached facts: none when damaged."""
    try:
        scores = RoundScores.read(bundle, scene.r2sego.round_index)
    except R2SEgoError:
        _take_over(scene, None)
        raise
    _take_over(scene, scores)


@bpy.app.handlers.persistent
def undone(scene: bpy.types.Scene, *_: object) -> None:
    """Remember the scores that the facts which undo or redo brought back are of."""
    scores, group = remembered_in(scene), scene.r2sego_views
    if group.stamp == _stamp(scores):
        return
    try:
        bundle = state.bundle_of(scene)
        scores = None if bundle is None else RoundScores.read(bundle, scene.r2sego.round_index)
    except (R2SEgoError, OSError):
        scores = None
    remember(scene.session_uid, scores if group.stamp == _stamp(scores) else None)


def _stamp(scores: RoundScores | None) -> str:
    return "" if scores is None else scores.mark


def _take_over(scene: bpy.types.Scene, scores: RoundScores | None) -> None:
    group = scene.r2sego_views
    remember(scene.session_uid, scores)
    group.ranked.clear()
    if scores is None:
        group.candidates = group.survivors = group.rollouts = 0
        group.note = group.stamp = ""
        group.active = -1
        return
    views = scores.views
    for index in scores.ranked():
        row = group.ranked.add()
        row.candidate, row.rollout, row.frame = int(index), int(views.rollout[index]), int(views.frame[index])
        row.score, row.chosen = float(views.score[index]), bool(views.chosen[index])
    group.candidates, group.survivors = len(scores), int(views.survived.sum())
    group.rollouts = scores.rollouts
    group.rollout = min(group.rollout, max(0, scores.rollouts - 1))
    group.best_s = float(views.score.max(initial=0.0))
    group.best_u, group.best_g = float(views.deficit.max()), float(views.availability.max())
    group.note = " ".join([*scores.told.ablations, scores.told.note]).strip()
    stamp = _stamp(scores)
    group.active = group.active if group.stamp == stamp else -1  # setting it writes its words anew
    group.stamp = stamp
    if state.may_show():
        follow(scene)
