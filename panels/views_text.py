"""Longer texts in the side bar, wrapped to its width."""

import textwrap

from .sidebar import fitting_characters


def write_wrapped(context, layout, text, icon="NONE"):
    """A text as lines that fit; ``icon`` stands before the first."""
    column = layout.column(align=True)
    for line in textwrap.wrap(text, fitting_characters(context, 0.88 if icon == "NONE" else 0.78)):
        column.label(text=line, icon=icon)
        icon = "BLANK1" if icon != "NONE" else icon
