"""Reads a round's generated views into the cached facts of the sub-panel."""

import bpy

from ...r2sego_blender.generation.view_records import ViewRecord
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.view_parts import clip_files, views_of_round


def read(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Fill the list of views. Raises GenerationError when a view's files are damaged."""
    group = scene.r2sego_generation
    group.views.clear()
    group.accepted = 0
    records = views_of_round(bundle, scene.r2sego.round_index)
    for record in records:
        _fill(group.views.add(), record)
    group.accepted = sum(record.accepted for record in records)
    if group.active >= len(records):
        group.active = max(0, len(records) - 1)


def forget_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """The ground truth was another bundle's."""
    scene.r2sego_generation.property_unset("truth")


def _fill(row: bpy.types.PropertyGroup, record: ViewRecord) -> None:
    figures = record.figures
    row.name = f"View {record.rank:03d}"
    row.rank, row.candidate = record.rank, record.candidate
    row.title = f"Rollout {record.rollout}, frame {record.frame}"
    row.reference = f"{record.reference}, sees {record.overlap:.0%}"
    row.accepted, row.by_hand = record.accepted, record.by_hand is not None
    row.fate, row.note = record.fate, record.note
    row.has_clip = bool(clip_files(record.folder))
    row.registration = row.residual = row.doubt = ""
    if "inliers" in figures:
        row.registration = (
            f"{figures['inliers']:.0f} of {figures['expected']:.0f} patches, "
            f"over {figures['spread']:.0%} of the image"
        )
    if record.has_estimate and "offset_m" in figures:
        row.residual = f"{1000 * figures['offset_m']:.1f} mm, {figures['turn_deg']:.2f} deg off"
        row.doubt = f"{1000 * figures['sigma_m']:.1f} mm, {figures['sigma_deg']:.2f} deg"
    row.stands_in = ""
    if record.replaces >= 0:
        row.stands_in = f"stands in for view {record.replaces}"
    if record.replaced_by >= 0:
        row.stands_in = f"{row.stands_in}, " * bool(row.stands_in) + f"replaced by view {record.replaced_by}"
