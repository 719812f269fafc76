"""The sub-panel Report: the scores, what the rounds did to them, and what causes the error left."""

import bpy

from .sidebar import Step, write_wrapped

_UNKNOWN = "\u2013"


class R2SEGO_PT_report(Step, bpy.types.Panel):
    """Scores on frozen views"""

    bl_idname = "R2SEGO_PT_report"
    bl_label = "Report"
    bl_order = 8

    def draw(self, context):
        layout = self.layout
        report = context.scene.r2sego_report
        if len(report.arms):
            _table(layout, report.arms, report.has_lpips)
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
        _table(self.layout, context.scene.r2sego_report.rounds, False)


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
            _line(column, "", ("of error", "of pixels"), False)
            for cause in report.causes:
                _line(column, cause.label, (_percent(cause.error), _percent(cause.pixels)), True)
        write_wrapped(context, self.layout, report.mending, "INFO")
        if report.causes_note:
            row = self.layout.row()
            row.active = False
            row.label(text=report.causes_note)


def _table(layout, scores, has_lpips):
    heads = ("PSNR", "SSIM", "LPIPS") if has_lpips else ("PSNR dB", "SSIM")
    column = layout.column(align=True)
    _line(column, "", heads, False)
    for score in scores:
        figures = (_figure(score.psnr, 2), _figure(score.ssim, 3), _figure(score.lpips, 3))
        _line(column, score.label, figures[: len(heads)], True)
        if score.note:
            row = column.row()
            row.active = False
            row.label(text=score.note, icon="BLANK1")


def _line(column, label, cells, active):
    split = column.split(factor=0.4)
    split.active = active
    split.label(text=label)
    grid = split.grid_flow(row_major=True, columns=len(cells), even_columns=True, align=True)
    for cell in cells:
        place = grid.row()
        place.alignment = "RIGHT"
        place.label(text=cell)


def _figure(value, digits):
    return _UNKNOWN if value is None else f"{value:.{digits}f}"


def _percent(value):
    return _UNKNOWN if value is None else f"{value:.0%}"


CLASSES = (R2SEGO_PT_report, R2SEGO_PT_report_rounds, R2SEGO_PT_report_causes)
