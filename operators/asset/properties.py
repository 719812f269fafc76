"""What a person chose of the visual asset: what is shown, marked and compared, and how it is drawn."""

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

from ...r2sego_blender.bridge.asset.show_asset import is_current, is_deleted, shown_stage, shows_another, shows_bundle
from ...r2sego_blender.bridge.shared.panel_facts import Fact
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bundle.asset_stages import PASSES
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from .. import state
from .facts import AssetFacts
from .marks import drop_marks
from .show_asset import show_stage


class R2SEGO_PG_asset_mark(bpy.types.PropertyGroup):
    """A region whose splats are to be deleted, as JSON."""

    region: StringProperty()
    kind: StringProperty()
    splats: IntProperty()


def _redraw(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    redraw_views("WINDOW")


def _stage(group: bpy.types.PropertyGroup) -> int:
    """The place of the chosen stage, of the newest where that is chosen or the other is gone."""
    listed = group.stages
    index = listed.find(group.chosen_stage)
    return index if index >= 0 else max(0, len(listed) - 1)


def _choose_stage(group: bpy.types.PropertyGroup, index: int) -> None:
    """Keep the slider on a stage; where an asset is shown, show the chosen one."""
    listed = group.stages
    if not listed:
        return
    wanted = listed[min(index, len(listed) - 1)].name
    group.chosen_stage = "" if wanted == listed[-1].name else wanted
    if shows_another(group.shown, wanted) and group.shown.mode != "EDIT":
        try:
            show_stage(group.id_data, wanted)
        except R2SEgoError as error:
            state.tell_problem(group.id_data, error)


class R2SEGO_PG_asset(bpy.types.PropertyGroup):
    """The room Asset."""

    stages, edits = Fact(AssetFacts), Fact(AssetFacts)
    chosen_stage: StringProperty(description="The name of the chosen asset; empty = the newest")
    stage: IntProperty(
        name="Shown",
        description="Which asset is shown: initial, after each round, final",
        min=0,
        get=_stage,
        set=_choose_stage,
    )
    shown: PointerProperty(type=bpy.types.Object)
    preview: BoolProperty(name="Preview", description="Draw the splats in the 3D views", default=True, update=_redraw)
    style: EnumProperty(
        name="Style",
        description="How the splats are drawn",
        update=_redraw,
        items=[
            ("GAUSSIANS", "Gaussians", "Blended as trained; where there is no graphics card, at rest only"),
            ("DISCS", "Discs", "Round and opaque: quick, and each splat can be told from its neighbours"),
        ],
    )
    share: FloatProperty(
        name="Share",
        description="How many of the splats are drawn",
        subtype="FACTOR",
        min=0.01,
        max=1.0,
        default=1.0,
        update=_redraw,
    )
    moving_share: FloatProperty(
        name="While Moving",
        description="How many of those are drawn while the view moves",
        subtype="FACTOR",
        min=0.01,
        max=1.0,
        default=0.25,
        update=_redraw,
    )
    size: FloatProperty(
        name="Size",
        description="Radius of a disc in standard deviations of its splat",
        min=0.1,
        max=5.0,
        soft_max=3.0,
        default=1.3,
        update=_redraw,
    )
    opacity: FloatProperty(
        name="Opacity",
        description="How opaque the splats are; less shows what is behind",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=1.0,
        update=_redraw,
    )
    backdrop: BoolProperty(
        name="Backdrop",
        default=False,
        update=_redraw,
        description="Draw also what stands far behind the room, where no photograph shows anything",
    )
    marks: CollectionProperty(type=R2SEGO_PG_asset_mark)
    marked: IntProperty()
    near: FloatProperty(
        name="Nearest",
        description="A lasso takes no splat nearer to the view than this",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=0.0,
    )
    far: FloatProperty(
        name="Farthest",
        description="A lasso takes no splat farther from the view than this",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=100.0,
    )
    edit_index: IntProperty(name="Edit", description="The deletion that Restore takes back")
    render_pass: EnumProperty(
        name="Pass",
        description="What the panel's buttons render",
        items=[(name, name.capitalize(), f"The {name} of each pixel") for name in PASSES],
    )
    compare: BoolProperty(
        name="Compare",
        description="Show two pictures in the camera's frame, divided where the wipe stands",
        update=_redraw,
    )
    wipe: FloatProperty(
        name="Wipe",
        description="Where the left picture ends and the right one begins",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=0.5,
        update=_redraw,
    )
    wipe_left: PointerProperty(
        name="Left", description="The picture on the left of the divider", type=bpy.types.Image, update=_redraw
    )
    wipe_right: PointerProperty(
        name="Right", description="The picture on the right of the divider", type=bpy.types.Image, update=_redraw
    )

    @property
    def older(self) -> bool:
        """Whether what is shown is older than its file."""
        name = shown_stage(self.shown)
        return name in self.stages and not is_current(self.shown, self.stages[name].written)


def forget_bundle(scene: bpy.types.Scene, _bundle: Bundle) -> None:
    """Compare no more pictures of another bundle, and mark nothing of it."""
    group = scene.r2sego_asset
    for name in ("compare", "wipe_left", "wipe_right", "marked"):
        group.property_unset(name)
    group.marks.clear()


def follow(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Show the newest asset where that is looked at, and anew what has changed; mark what is still there."""
    group = scene.r2sego_asset
    if group.shown is not None and is_deleted(group.shown):
        group.shown = None
    if group.shown is not None and not shows_bundle(group.shown, bundle):
        group.shown = None
        group.marks.clear()
        group.marked = 0
    if group.shown is not None and group.shown.mode != "EDIT" and group.stages:
        newest = group.stages[-1].name
        if not group.chosen_stage and shows_another(group.shown, newest):
            show_stage(scene, newest)
        elif group.older:
            show_stage(scene, shown_stage(group.shown))
    drop_marks(scene)
    group.edit_index = min(group.edit_index, max(0, len(group.edits) - 1))
