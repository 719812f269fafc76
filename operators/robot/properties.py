"""What a person chose in the sub-panel Robot: which attempts are listed, how many a trial makes."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.shared.panel_facts import Fact, facts_of
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.results.policy_evaluation import MOST_EPISODES
from .. import state
from .facts import AttemptFacts, PolicyFacts, ScopeFacts


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
    evaluation, episodes = Fact(PolicyFacts), Fact(PolicyFacts)
    region, seats = Fact(ScopeFacts), Fact(ScopeFacts)
    attempt_index: IntProperty(name="Attempt", description="The attempt whose particulars are shown", min=0)
    seat_index: IntProperty(name="Seat", description="The chosen seat", min=0)
    trial_attempts: IntProperty(
        name="Attempts", description="How many attempts a trial makes", default=6, min=1, max=1000
    )
    policy: StringProperty(
        name="Policy",
        description="The folder of a training to evaluate; empty for the teacher, which knows the true state",
        subtype="DIR_PATH",
    )
    policy_episodes: IntProperty(
        name="Episodes", description="How many episodes an evaluation tries", default=20, min=1, max=MOST_EPISODES
    )
    episode_index: IntProperty(name="Episode", description="The episode whose particulars are shown", min=0)
    show_region: BoolProperty(
        name="Show Region",
        description="Draw the behaviour region on the floor of the 3D view",
        default=True,
        update=lambda group, context: redraw_views(),
    )
    drawing: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    @property
    def problem(self) -> str:
        """What of the robot, its attempts or a policy's cannot be read, '' when all can."""
        scene = self.id_data
        problems = (facts_of(scene, kind).problem for kind in (ScopeFacts, AttemptFacts, PolicyFacts))
        return next(filter(None, problems), "")
