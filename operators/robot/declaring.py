"""What the operators share that declare something of the robot: the engine's one command for it."""

from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class DeclaringOperator(EngineOperator):
    """An operator that has the engine check and write a part of the declaration."""

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def changes(self, context) -> list[str]:
        """The options of ``r2sego robot`` that declare it. May raise R2SEgoError."""
        raise NotImplementedError

    def arguments(self, context):
        return ["robot", str(state.opened_bundle(context).path), *self.changes(context), "--json-progress"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"Declared: {result.get('name', 'the robot')}, {result.get('scope', 'its scope')}"
