"""What the sub-panel Robot knows: the robot's behaviour, its seats and its attempts."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from . import facts


class R2SEGO_PG_attempt(bpy.types.PropertyGroup):
    """One attempt at the behaviour."""

    number: IntProperty()
    behaviour: StringProperty()
    success: BoolProperty()
    reason: StringProperty()
    outcome: StringProperty()
    frame: IntProperty()
    frames: IntProperty()
    time_s: FloatProperty(subtype="TIME_ABSOLUTE", unit="TIME_ABSOLUTE")


class R2SEGO_PG_seat(bpy.types.PropertyGroup):
    """A surface the robot could sit on."""

    object_name: StringProperty()
    place: FloatVectorProperty(size=2, subtype="XYZ_LENGTH", unit="LENGTH")
    height: FloatProperty(subtype="DISTANCE", unit="LENGTH")
    places: IntProperty()


class R2SEGO_PG_robot(bpy.types.PropertyGroup):
    """The behaviour scope of the open bundle, and the attempts that are listed."""

    source: EnumProperty(
        name="Attempts", description="Which attempts are listed and shown",
        items=[
            ("ROUND", "Round", "Those of the round that is shown"),
            ("TRIAL", "Trial", "Those of the last Try Rollouts"),
        ],
        update=lambda group, context: facts.read_again(group.id_data),
    )  # fmt: skip
    listed: EnumProperty(
        name="Listed", description="Which attempts stand in the list",
        items=[
            ("ALL", "All", "Every attempt"),
            ("SUCCEEDED", "Succeeded", "Those that give candidate views"),
            ("FAILED", "Failed", "Those that were discarded, with the reason"),
        ],
    )  # fmt: skip
    attempts: CollectionProperty(type=R2SEGO_PG_attempt)
    attempt_index: IntProperty(name="Attempt", description="The attempt whose particulars are shown", min=0)
    succeeded: IntProperty()
    seats: CollectionProperty(type=R2SEGO_PG_seat)
    seat_index: IntProperty(name="Seat", description="The chosen seat", min=0)
    trial_attempts: IntProperty(
        name="Attempts", description="How many attempts a trial makes", default=6, min=1, max=1000,
    )  # fmt: skip
    show_region: BoolProperty(
        name="Show Region", description="Draw the behaviour region on the floor of the 3D view",
        default=True, update=lambda group, context: redraw_views(),
    )  # fmt: skip
    region: StringProperty(options={"HIDDEN"})
    drawing: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    problem: StringProperty(options={"HIDDEN"})
