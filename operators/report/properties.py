"""What the room Report remembers: the figures of the last evaluation."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, PointerProperty, StringProperty

from ...r2sego_blender.results.panels.report_scores import ReportScores, report_scores


class R2SEGO_PG_score(bpy.types.PropertyGroup):
    """The scores of an arm or of a round; a score below 0 is not known."""

    psnr: FloatProperty(default=-1.0)
    ssim: FloatProperty(default=-1.0)
    lpips: FloatProperty(default=-1.0)
    note: StringProperty()


class R2SEGO_PG_cause(bpy.types.PropertyGroup):
    """A cause of the refined asset's error; a share below 0 is not known."""

    error: FloatProperty(default=-1.0)
    pixels: FloatProperty(default=-1.0)


class R2SEGO_PG_report(bpy.types.PropertyGroup):
    """The figures of ``report/metrics.json``."""

    arms: CollectionProperty(type=R2SEGO_PG_score)
    rounds: CollectionProperty(type=R2SEGO_PG_score)
    causes: CollectionProperty(type=R2SEGO_PG_cause)
    causes_note: StringProperty()
    mending: StringProperty()
    has_lpips: BoolProperty()
    outdated: BoolProperty()
    summary: StringProperty()


CLASSES = (R2SEGO_PG_score, R2SEGO_PG_cause, R2SEGO_PG_report)


def read_report(scene, bundle):
    """Take the figures of a bundle over, or none before an evaluation or when they are damaged."""
    _show(scene.r2sego_report, ReportScores())
    _show(scene.r2sego_report, report_scores(bundle))


def _show(group, scores):
    _fill(group.arms, scores.arms)
    _fill(group.rounds, scores.rounds)
    group.causes.clear()
    for cause in scores.causes:
        shown = group.causes.add()
        shown.name = cause.label
        shown.error, shown.pixels = _known(cause.error), _known(cause.pixels)
    group.causes_note, group.mending = scores.causes_note, scores.mending
    group.has_lpips = any(arm.lpips is not None for arm in scores.arms)
    group.outdated, group.summary = scores.outdated, scores.summary


def _fill(shown, scores):
    shown.clear()
    for score in scores:
        line = shown.add()
        line.name, line.note = score.label, score.note
        line.psnr, line.ssim, line.lpips = _known(score.psnr), _known(score.ssim), _known(score.lpips)


def _known(value):
    return -1.0 if value is None else value


def attach():
    """Give every Blender scene the room's properties."""
    bpy.types.Scene.r2sego_report = PointerProperty(type=R2SEGO_PG_report)


def detach():
    """Take them away."""
    del bpy.types.Scene.r2sego_report
