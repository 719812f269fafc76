"""What the sub-panel Generation knows of the round's generated views."""

from collections.abc import Hashable
from dataclasses import dataclass

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import Facts, facts_of
from ...r2sego_blender.generation.view_effects import ViewEffect, effects_of_round
from ...r2sego_blender.generation.view_records import ViewRecord
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.view_parts import clip_files, views_of_round


@dataclass(frozen=True)
class GeneratedView:
    """A generated view and what became of it, in words; '' where there is nothing to tell.

    ``rank`` is its place in the selection, ``candidate`` its number in the candidate stream; ``fate`` says
    why it is ``accepted`` or not, ``replacement`` which view it replaces or is replaced by, ``effect`` what the
    round's update made of it, and ``note`` what is out of the ordinary on the camera's way.
    """

    name: str
    rank: int
    candidate: int
    title: str
    reference: str
    accepted: bool
    by_hand: bool
    fate: str
    note: str
    has_clip: bool
    registration: str
    residual: str
    uncertainty: str
    replacement: str
    effect: str


@dataclass(frozen=True)
class GenerationFacts:
    """The generated views of the round, and how many of them the asset is trained on."""

    views: Facts = Facts()
    accepted: int = 0


def read(scene: bpy.types.Scene, bundle: Bundle) -> GenerationFacts:
    """The round's views. Raises R2SEgoError when a view's files, or the round's counts, are damaged."""
    index = scene.r2sego.round_index
    effects = effects_of_round(bundle.scene, index)
    views = Facts(_told(record, effects.get(record.rank)) for record in views_of_round(bundle, index))
    return GenerationFacts(views, sum(view.accepted for view in views))


def chosen_round(scene: bpy.types.Scene) -> Hashable:
    """The round that is shown."""
    return scene.r2sego.round_index


def follow(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Choose a view that there is."""
    group, count = scene.r2sego_generation, len(facts_of(scene, GenerationFacts).views)
    if group.active >= count:
        group.active = max(0, count - 1)


def forget_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """The ground truth was another bundle's."""
    scene.r2sego_generation.property_unset("truth")


def _told(record: ViewRecord, effect: ViewEffect | None) -> GeneratedView:
    figures = record.figures
    registration = residual = uncertainty = replacement = ""
    if "inliers" in figures:
        registration = (
            f"{figures['inliers']:.0f} of {figures['expected']:.0f} patches, over {figures['spread']:.0%} of the image"
        )
    if record.has_estimate and "offset_m" in figures:
        residual = f"{1000 * figures['offset_m']:.1f} mm, {figures['turn_deg']:.2f} deg off"
        uncertainty = f"{1000 * figures['sigma_m']:.1f} mm, {figures['sigma_deg']:.2f} deg"
    if record.replaces >= 0:
        replacement = f"stands in for view {record.replaces}"
    if record.replaced_by >= 0:
        replacement += ", " * bool(replacement) + f"replaced by view {record.replaced_by}"
    return GeneratedView(
        name=f"View {record.rank:03d}",
        rank=record.rank,
        candidate=record.candidate,
        title=f"Rollout {record.rollout}, frame {record.frame}",
        reference=f"{record.reference}, sees {record.overlap:.0%}",
        accepted=record.accepted,
        by_hand=record.by_hand is not None,
        fate=record.fate,
        note=record.note,
        has_clip=bool(clip_files(record.folder)),
        registration=registration,
        residual=residual,
        uncertainty=uncertainty,
        replacement=replacement,
        effect="" if effect is None else str(effect),
    )
