"""The room Report: the figures of the last evaluation, and its page.

Its facts are the library's ``ReportScores`` as they are. May use the library, no other room.
"""

from bpy.props import PointerProperty
from bpy.types import PropertyGroup, Scene

from ...r2sego_blender.bridge.shared.panel_facts import Fact
from ...r2sego_blender.results.panels.report_scores import ReportScores, report_scores
from .. import state


class R2SEGO_PG_report(PropertyGroup):
    """The figures of the last evaluation, none before one or when they are damaged."""

    arms, rounds, causes = Fact(ReportScores), Fact(ReportScores), Fact(ReportScores)
    causes_note, mending, has_lpips = Fact(ReportScores), Fact(ReportScores), Fact(ReportScores)
    outdated, summary = Fact(ReportScores), Fact(ReportScores)


def register() -> None:
    """Attach the room's facts; the figures of every opened bundle are read."""
    Scene.r2sego_report = PointerProperty(type=R2SEGO_PG_report)
    state.readers[ReportScores] = state.Reader(lambda scene, bundle: report_scores(bundle))


def unregister() -> None:
    """Take them away."""
    del state.readers[ReportScores]
    del Scene.r2sego_report
