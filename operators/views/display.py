"""Keeps the frusta in the view in step with the bundle, and with how a person wants them shown."""

import bpy

from ...r2sego_blender.bridge.views.show_candidates import (
    mark_candidate,
    recolour_candidates,
    show_candidates,
    shown_candidates,
)
from ...r2sego_blender.results.panels.bundle import Bundle
from .. import state


def show(scene: bpy.types.Scene, bundle: Bundle) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Show the candidates as the properties ask; see ``show_candidates``."""
    group = scene.r2sego_views
    swarm, targets = show_candidates(
        scene,
        bundle,
        scene.r2sego.round_index,
        frustum_m=group.frustum_size,
        shown=group.shown.lower(),
        colour_by=group.colour_by.lower(),
    )
    scores = group.scores
    if scores is not None:
        swarm["stamp"] = scores.stamp
        mark_candidate(scene, scores.bundle_path, scores.views, group.active, group.frustum_size)
    return swarm, targets


def follow(scene: bpy.types.Scene) -> None:
    """Where frusta are shown, make them those that the properties and the bundle ask for.

    A change of the colour alone is quick. Raises R2SEgoError when the bundle is damaged.
    """
    group = scene.r2sego_views
    scores = group.scores
    swarm = None if scores is None else shown_candidates(scene, scores.bundle_path)
    if swarm is None:
        return
    asked = (scores.stamp, group.shown.lower(), round(group.frustum_size, 6))
    if (swarm.get("stamp"), swarm["shown"], round(swarm["frustum_m"], 6)) != asked:
        show(scene, state.bundle_of(scene))
    else:
        recolour_candidates(swarm, group.colour_by.lower())


def follow_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Choose a rollout that there is; show a new selection's frusta, in which no candidate is active."""
    group = scene.r2sego_views
    scores = group.scores
    if scores is None:
        return
    group.rollout = min(group.rollout, max(0, scores.rollouts - 1))
    if group.active < 0:
        mark_candidate(scene, scores.bundle_path, scores.views, -1, group.frustum_size)
    follow(scene)
