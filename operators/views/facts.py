"""What the sub-panel Views knows of the round's candidates."""

from collections.abc import Hashable
from dataclasses import dataclass

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import Facts
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.view_scores import RoundScores


@dataclass(frozen=True)
class ViewFacts:
    """The round's scores, None before it has a selection, and the list of its target views."""

    scores: RoundScores | None = None
    ranked: Facts = Facts()

    @property
    def candidates(self) -> int:
        """How many candidates the round has."""
        return 0 if self.scores is None else len(self.scores)

    @property
    def rollouts(self) -> int:
        """How many rollouts the candidates are of."""
        return 0 if self.scores is None else self.scores.rollouts


def read(scene: bpy.types.Scene, bundle: Bundle) -> ViewFacts:
    """The scores of the round that is shown. Raises R2SEgoError when they are damaged."""
    scores = RoundScores.read(bundle, scene.r2sego.round_index)
    return ViewFacts() if scores is None else ViewFacts(scores, Facts(scores.ranked))


def chosen_round(scene: bpy.types.Scene) -> Hashable:
    """The round that is shown."""
    return scene.r2sego.round_index
