"""What the room Captures knows of the open bundle, and what a person's picks in it come to."""

from collections.abc import Hashable
from dataclasses import dataclass

import bpy

from ...r2sego_blender.bridge.captures.registration_marks import registration_of
from ...r2sego_blender.bridge.shared.panel_facts import Facts, facts_of
from ...r2sego_blender.captures.frame.correction_history import corrections_of
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.capture_list import listed_captures
from ...r2sego_blender.results.panels.picks import PickFacts, fit_of, picks_of
from ...r2sego_blender.results.panels.sparse_cloud import read_cloud


@dataclass(frozen=True)
class CaptureFacts:
    """The list of captures, how many corrections can be taken back, and how the world is registered."""

    captures: Facts = Facts()
    corrections: int = 0
    registration: tuple[float, ...] = ()


def read(_scene: bpy.types.Scene, bundle: Bundle) -> CaptureFacts:
    """The captures; their points are read to be drawn."""
    listed = Facts(listed_captures(bundle))
    read_cloud(bundle)
    return CaptureFacts(listed, len(corrections_of(bundle.path)), tuple(registration_of(bundle)))


def read_picks(scene: bpy.types.Scene, bundle: Bundle) -> PickFacts:
    """What the picks come to."""
    return fit_of(picks_of(scene.r2sego_captures), bundle)


def chosen_picks(scene: bpy.types.Scene) -> Hashable:
    """The picks."""
    return picks_of(scene.r2sego_captures)


def follow(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Choose a capture that there is, and note by which captures the bundle is known."""
    listed = facts_of(scene, CaptureFacts).captures
    if not listed:
        return
    group, names = scene.r2sego_captures, "\n".join(one.name for one in listed)
    if names != scene.r2sego.kept_captures:
        scene.r2sego.kept_captures, group.active_capture = names, 0
    if not group.height_capture:
        group.height_capture = listed[0].name


def forget_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Forget what was picked and chosen in another bundle."""
    group = scene.r2sego_captures
    for kept in (group.points, group.lengths, group.residuals):
        kept.clear()
    for name in ("active_capture", "active_point", "use_camera_height", "height_capture", "camera_height"):
        group.property_unset(name)
