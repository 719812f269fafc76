"""What the operators share that show rollouts: bodies that are not written yet are asked of the engine."""

from bpy.props import BoolProperty, IntProperty

from ...r2sego_blender.core.errors import R2SEgoError, SceneError
from ...r2sego_blender.results.panels.rollout_bodies import are_written
from ...r2sego_blender.results.panels.rollout_list import TRIAL
from .. import state
from ..base import EngineOperator, needs_bundle, told
from .facts import round_of


class ShowingOperator(EngineOperator):
    """An operator whose ``show`` needs the robot's bodies along a round's rollouts."""

    round_index: IntProperty(
        name="Round", description="The round, from 0; -1 is the one that is shown", default=-1, min=-1
    )
    trial: BoolProperty(name="Trial", description="The attempts of the last Try Rollouts, not a round's", default=False)
    attempt: IntProperty(name="Attempt", description="The attempt's number, from 0", default=0, min=0)

    @classmethod
    def poll(cls, context):
        if not needs_bundle(cls, context):
            return False
        if not len(context.scene.r2sego_robot.attempts):
            cls.poll_message_set("There are no rollouts yet: run Refine, or Try Rollouts")
            return False
        return True

    def show(self, context, bundle, round_index) -> str:
        """Show it; returns one line for the person. Raises R2SEgoError before it changes anything."""
        raise NotImplementedError

    def execute(self, context):
        try:
            bundle, index = self._chosen(context)
            if self.job_folder or not are_written(bundle, index):
                return super().execute(context)
            said = self.show(context, bundle, index)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        self.report({"INFO"}, said)
        return {"FINISHED"}

    def arguments(self, context):
        bundle, index = self._chosen(context)
        if index == TRIAL:
            raise SceneError("the trial's bodies are missing", where=bundle.path, cure="Try Rollouts again.")
        return ["robot-bodies", str(bundle.path), "--round", str(index), "--json-progress"]

    def finish(self, context, result):
        return self.show(context, *self._chosen(context))

    def _chosen(self, context):
        return state.opened_bundle(context), round_of(context.scene, self.trial, self.round_index)
