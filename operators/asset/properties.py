"""What Blender remembers of the visual asset: what is shown, marked, deleted and compared."""

from collections.abc import Mapping
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ...r2sego_blender.bridge.asset.show_asset import (
    is_current,
    is_deleted,
    shown_stage,
    shows_another,
    shows_bundle,
)
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bundle.asset_stages import FINAL, INITIAL, PASSES, stages
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.report_scores import not_scored
from ...r2sego_blender.splats.asset_edits import ASSET_EDITS
from ...r2sego_blender.splats.formats.ply_vertices import vertex_count
from .. import state
from .marks import drop_marks
from .show_asset import show_stage

_FEW_SPLATS = 10000


class R2SEGO_PG_asset_stage(bpy.types.PropertyGroup):
    """An asset the bundle holds; its name is initial, a round's number or final."""

    label: StringProperty()
    gaussians: IntProperty()


class R2SEGO_PG_asset_mark(bpy.types.PropertyGroup):
    """A region whose splats are to be deleted, as JSON."""

    region: StringProperty()
    kind: StringProperty()
    splats: IntProperty()


class R2SEGO_PG_asset_edit(bpy.types.PropertyGroup):
    """A deletion that the bundle keeps."""

    regions: StringProperty()


def _redraw(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    redraw_views("WINDOW")


def _other_stage(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Keep the slider on a stage; where an asset is shown, show the chosen one."""
    highest = max(0, len(group.stages) - 1)
    if group.stage > highest:
        group.stage = highest  # comes here again
        return
    if not group.stages or not state.may_show():
        return
    wanted = group.stages[group.stage].name
    if shows_another(group.shown, wanted) and group.shown.mode != "EDIT":
        try:
            show_stage(group.id_data, wanted)
        except R2SEgoError as error:
            group.id_data.r2sego.problem = str(error)


class R2SEGO_PG_asset(bpy.types.PropertyGroup):
    """The room Asset."""

    stages: CollectionProperty(type=R2SEGO_PG_asset_stage)
    stage: IntProperty(
        name="Shown", description="Which asset is shown: initial, after each round, final", min=0,
        update=_other_stage,
    )  # fmt: skip
    shown: PointerProperty(type=bpy.types.Object)
    older: BoolProperty()
    """Whether what is shown is older than its file."""
    revision: IntProperty()
    """Another number for other marks: what was drawn of them is kept by it."""
    preview: BoolProperty(
        name="Preview", description="Draw the splats in the 3D views", default=True, update=_redraw,
    )  # fmt: skip
    style: EnumProperty(
        name="Style", description="How the splats are drawn", update=_redraw,
        items=[
            ("GAUSSIANS", "Gaussians", "Blended as trained; where there is no graphics card, at rest only"),
            ("DISCS", "Discs", "Round and opaque: quick, and each splat can be told from its neighbours"),
        ],
    )  # fmt: skip
    share: FloatProperty(
        name="Share", description="How many of the splats are drawn", subtype="FACTOR",
        min=0.01, max=1.0, default=1.0, update=_redraw,
    )  # fmt: skip
    moving_share: FloatProperty(
        name="While Moving", description="How many of those are drawn while the view moves",
        subtype="FACTOR", min=0.01, max=1.0, default=0.25, update=_redraw,
    )  # fmt: skip
    size: FloatProperty(
        name="Size", description="Radius of a disc in standard deviations of its splat",
        min=0.1, max=5.0, soft_max=3.0, default=1.3, update=_redraw,
    )  # fmt: skip
    opacity: FloatProperty(
        name="Opacity", description="How opaque the splats are; less shows what is behind",
        subtype="FACTOR", min=0.0, max=1.0, default=1.0, update=_redraw,
    )  # fmt: skip
    backdrop: BoolProperty(
        name="Backdrop", default=False, update=_redraw,
        description="Draw also what stands far behind the room, where no photograph shows anything",
    )  # fmt: skip
    marks: CollectionProperty(type=R2SEGO_PG_asset_mark)
    marked: IntProperty()
    near: FloatProperty(
        name="Nearest", description="A lasso takes no splat nearer to the view than this",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=0.0,
    )  # fmt: skip
    far: FloatProperty(
        name="Farthest", description="A lasso takes no splat farther from the view than this",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=100.0,
    )  # fmt: skip
    edits: CollectionProperty(type=R2SEGO_PG_asset_edit)
    edit_index: IntProperty(name="Edit", description="The deletion that Restore takes back")
    render_pass: EnumProperty(
        name="Pass", description="What the panel's buttons render",
        items=[(name, name.capitalize(), f"The {name} of each pixel") for name in PASSES],
    )  # fmt: skip
    compare: BoolProperty(
        name="Compare", description="Show two pictures in the camera's frame, divided where the wipe stands",
        update=_redraw,
    )  # fmt: skip
    wipe: FloatProperty(
        name="Wipe", description="Where the left picture ends and the right one begins",
        subtype="FACTOR", min=0.0, max=1.0, default=0.5, update=_redraw,
    )  # fmt: skip
    wipe_left: PointerProperty(
        name="Left", description="The picture on the left of the divider", type=bpy.types.Image,
        update=_redraw,
    )  # fmt: skip
    wipe_right: PointerProperty(
        name="Right", description="The picture on the right of the divider", type=bpy.types.Image,
        update=_redraw,
    )  # fmt: skip


def forget_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Compare no more pictures of another bundle, and mark nothing of it."""
    group = scene.r2sego_asset
    for name in ("compare", "wipe_left", "wipe_right", "marked"):
        group.property_unset(name)
    group.marks.clear()


def read_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """The listener: take the bundle's assets, edits and scores over."""
    group = scene.r2sego_asset
    if group.shown is not None and is_deleted(group.shown):
        group.shown = None
    if group.shown is not None and not shows_bundle(group.shown, bundle):
        group.shown = None
        group.marks.clear()
        group.marked = 0
    last = not group.stages or group.stage == len(group.stages) - 1
    group.stages.clear()
    metrics = bundle.metrics()
    scores, changed = _scores(metrics), not_scored(bundle, metrics)
    for stage in stages(bundle.scene):
        item = group.stages.add()
        item.name, item.label, item.gaussians = stage.name, stage.label, vertex_count(stage.file)
        told = [_count(item.gaussians)]
        score = scores.pop(stage.name, None)
        if score is not None and stage.target not in changed:
            told.append(f"{score:.2f} dB")
        _tell(scene, stage.label, ", ".join(told))
    for name, score in scores.items():
        if score is not None:
            _tell(scene, name, f"{score:.2f} dB")
    # Who looked at the newest asset goes on to the newest; else the slider stays where it is.
    wanted = len(group.stages) - 1 if last else min(group.stage, len(group.stages) - 1)
    if group.stage != max(0, wanted):
        group.stage = max(0, wanted)
    _show_anew(scene, bundle)
    group.edits.clear()
    deleted = []
    for edit in bundle.scene.read(ASSET_EDITS):
        item, regions = group.edits.add(), [region.to_json() for region in edit.regions]
        item.name, item.regions = edit.name, ", ".join(region["kind"] for region in regions)
        deleted += regions
    drop_marks(scene, deleted)
    group.edit_index = min(group.edit_index, max(0, len(group.edits) - 1))


def _show_anew(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Where the shown asset's file has changed since, show it as it is now, or say that it is older."""
    group = scene.r2sego_asset
    shown, group.older = group.shown, False
    if shown is None:
        return
    for stage in stages(bundle.scene):
        if stage.name == shown_stage(shown) and not is_current(shown, stage):
            if shown.mode == "EDIT" or not state.may_show():
                group.older = True
            else:
                show_stage(scene, stage.name)


def _scores(metrics: Mapping[str, Any]) -> dict[str, float | None]:
    """The PSNR of each stage and of other assets on frozen views, by name, as last evaluated."""
    names = {"initial": INITIAL, "refined": FINAL, "vanilla_3dgs": "Vanilla"}
    scores = {names.get(name, name): arm["psnr"] for name, arm in (metrics.get("arms") or {}).items()}
    return scores | {str(one["round"]): one["psnr"] for one in metrics.get("rounds") or ()}


def _count(gaussians: int) -> str:
    """So short that a score has room beside it."""
    return f"{gaussians} splats" if gaussians < _FEW_SPLATS else f"{gaussians / 1000:.0f}k splats"


def _tell(scene: bpy.types.Scene, label: str, value: str) -> None:
    fact = scene.r2sego.facts.add()
    fact.section, fact.label, fact.value = "asset", label, value


CLASSES = (R2SEGO_PG_asset_stage, R2SEGO_PG_asset_mark, R2SEGO_PG_asset_edit, R2SEGO_PG_asset)
