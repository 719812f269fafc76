"""The sub-panel Report: the scores, what the rounds did to them, and what causes the error left."""

import bpy

from .sidebar import Step, fitting_characters, wrapped, write_wrapped

_UNKNOWN = "\u2013"
_LABEL_SHARE = 0.4


class R2SEGO_PT_report(Step, bpy.types.Panel):
    """Scores on frozen views"""

    bl_idname = "R2SEGO_PT_report"
    bl_label = "Report"
    bl_order = 8

    def draw(self, context):
        layout = self.layout
        report = context.scene.r2sego_report
        if len(report.arms):
            _table(context, layout, report.arms, report.has_lpips)
            if report.outdated:
                layout.label(text="The asset changed since", icon="INFO")
        elif context.scene.r2sego.bundle:
            layout.label(text="Not evaluated yet", icon="INFO")
        row = layout.row(align=True)
        row.operator("r2sego.evaluate", icon="VIEWZOOM")
        row.operator("r2sego.open_report", icon="URL")


class R2SEGO_PT_report_rounds(Step, bpy.types.Panel):
    """The scores after each round"""

    bl_idname = "R2SEGO_PT_report_rounds"
    bl_label = "Rounds"
    bl_parent_id = "R2SEGO_PT_report"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return len(context.scene.r2sego_report.rounds) > 0

    def draw(self, context):
        _table(context, self.layout, context.scene.r2sego_report.rounds, False)


class R2SEGO_PT_report_causes(Step, bpy.types.Panel):
    """What causes the refined asset's error"""

    bl_idname = "R2SEGO_PT_report_causes"
    bl_label = "Causes of Error"
    bl_parent_id = "R2SEGO_PT_report"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        report = context.scene.r2sego_report
        return len(report.causes) > 0 or bool(report.causes_note)

    def draw(self, context):
        report = context.scene.r2sego_report
        if len(report.causes):
            column = self.layout.column(align=True)
            _line(context, column, "", ("of error", "of pixels"), False)
            for cause in report.causes:
                _line(context, column, cause.label, (_percent(cause.error), _percent(cause.pixels)), True)
        write_wrapped(context, self.layout, report.mending, "INFO")
        _note(context, self.layout, report.causes_note)


def _table(context, layout, scores, has_lpips):
    heads = ("PSNR", "SSIM", "LPIPS") if has_lpips else ("PSNR dB", "SSIM")
    column = layout.column(align=True)
    _line(context, column, "", heads, False)
    for score in scores:
        figures = (_figure(score.psnr, 2), _figure(score.ssim, 3), _figure(score.lpips, 3))
        _line(context, column, score.label, figures[: len(heads)], True)
        _note(context, column, score.note, "BLANK1")


def _line(context, column, label, cells, active):
    first, *further = wrapped(label, fitting_characters(context, _LABEL_SHARE)) or ("",)
    split = column.split(factor=_LABEL_SHARE)
    split.active = active
    split.label(text=first)
    grid = split.grid_flow(row_major=True, columns=len(cells), even_columns=True, align=True)
    for cell in cells:
        place = grid.row()
        place.alignment = "RIGHT"
        place.label(text=cell)
    for line in further:
        column.label(text=line)


def _note(context, layout, note, icon="NONE"):
    if note:
        column = layout.column()
        column.active = False
        write_wrapped(context, column, note, icon)


def _figure(value, digits):
    return _UNKNOWN if value is None else f"{value:.{digits}f}"


def _percent(value):
    return _UNKNOWN if value is None else f"{value:.0%}"


CLASSES = (R2SEGO_PT_report, R2SEGO_PT_report_rounds, R2SEGO_PT_report_causes)
