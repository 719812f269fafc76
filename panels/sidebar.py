"""The side bar's tab, and what its sub-panels share. Panels draw cached facts only."""

import textwrap
from functools import lru_cache
from itertools import zip_longest

import bpy

_LABEL_SHARE = 0.38
_LABEL_CHARACTERS = 13  # "Convex Pieces" fits in a side bar as Blender opens it
_CHARACTER_PX = 8.2  # of Blender's interface font at scale 1, margins included


class Sidebar:
    """A panel of the tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "R2S-EGO"


class Step(Sidebar):
    """A sub-panel; ``section`` names the facts it shows."""

    bl_parent_id = "R2SEGO_PT_main"
    section = ""

    def draw_facts(self, context):
        """The open bundle's facts of this section, label and value."""
        facts = [fact for fact in context.scene.r2sego.facts if fact.section == self.section]
        if facts:
            column = self.layout.column(align=True)
            write_facts(context, column, [(fact.label, fact.value) for fact in facts])


@lru_cache(maxsize=1024)
def wrapped(text, characters):
    """The lines of a text; kept, since panels draw the same texts at each redraw."""
    return tuple(textwrap.wrap(text, characters))


def fitting_characters(context, share):
    """How many characters fit in this share of the side bar, roughly."""
    scale = context.preferences.system.ui_scale
    return max(12, int(share * context.region.width / (_CHARACTER_PX * scale)))


def write_facts(context, column, facts):
    """Pairs of a label and a value as grey labels with the values beside them, both wrapped."""
    of_label, of_value = (fitting_characters(context, share) for share in (_LABEL_SHARE, 1.0 - _LABEL_SHARE))
    fitting = max(_LABEL_CHARACTERS, of_label), of_value
    for fact in facts:
        for label, line in zip_longest(*map(wrapped, fact, fitting), fillvalue=""):
            row = column.split(factor=_LABEL_SHARE)
            name = row.row()
            name.active = False
            name.label(text=label)
            row.label(text=line)


def write_wrapped(context, layout, text, icon="NONE"):
    """A text as lines that fit; ``icon`` stands before the first."""
    column = layout.column(align=True)
    for line in wrapped(text, fitting_characters(context, 0.88 if icon == "NONE" else 0.78)):
        column.label(text=line, icon=icon)
        icon = "BLANK1" if icon != "NONE" else icon


def draw_problem(context, layout, text):
    """A long line of text as a red box, wrapped."""
    box = layout.box()
    box.alert = True
    lines = wrapped(text, fitting_characters(context, 0.85))
    for line, icon in zip_longest(lines, ["ERROR"], fillvalue="BLANK1"):
        box.label(text=line, icon=icon)


class R2SEGO_PT_main(Sidebar, bpy.types.Panel):
    """From photographs to a scene a robot can be trained in"""

    bl_idname = "R2SEGO_PT_main"
    bl_label = "R2S-EGO"

    def draw(self, context):
        if context.scene.r2sego.problem:
            draw_problem(context, self.layout, context.scene.r2sego.problem)


CLASSES = (R2SEGO_PT_main,)
