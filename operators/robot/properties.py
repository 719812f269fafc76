"""What a person chose in the sub-panel Robot: which attempts are listed, how many a trial makes."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.shared.panel_facts import Fact, facts_of
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from .. import state
from .facts import AttemptFacts, ScopeFacts


class R2SEGO_PG_robot(bpy.types.PropertyGroup):
    """The room Robot."""

    source: EnumProperty(
        name="Attempts",
        description="Which attempts are listed and shown",
        items=[
            ("ROUND", "Round", "Those of the round that is shown"),
            ("TRIAL", "Trial", "Those of the last Try Rollouts"),
        ],
        update=lambda group, context: state.catch_up(group.id_data),
    )
    listed: EnumProperty(
        name="Listed",
        description="Which attempts stand in the list",
        items=[
            ("ALL", "All", "Every attempt"),
            ("SUCCEEDED", "Succeeded", "Those that give candidate views"),
            ("FAILED", "Failed", "Those that were discarded, with the reason"),
        ],
    )
    attempts, succeeded = Fact(AttemptFacts), Fact(AttemptFacts)
    region, seats = Fact(ScopeFacts), Fact(ScopeFacts)
    attempt_index: IntProperty(name="Attempt", description="The attempt whose particulars are shown", min=0)
    seat_index: IntProperty(name="Seat", description="The chosen seat", min=0)
    trial_attempts: IntProperty(
        name="Attempts", description="How many attempts a trial makes", default=6, min=1, max=1000
    )
    show_region: BoolProperty(
        name="Show Region",
        description="Draw the behaviour region on the floor of the 3D view",
        default=True,
        update=lambda group, context: redraw_views(),
    )
    drawing: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    @property
    def problem(self) -> str:
        """What of the robot or its attempts cannot be read, '' when all can."""
        scene = self.id_data
        return facts_of(scene, ScopeFacts).problem or facts_of(scene, AttemptFacts).problem
