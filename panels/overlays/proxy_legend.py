"""What the colours of the shown proxy mean, below the button that shows it."""

from .swatches import swatch


def draw_legend(layout, group) -> None:
    """What each colour of the shown proxy means, and its area."""
    if group.older:
        layout.label(text="Redone since: press Show", icon="INFO")
    if group.legend_note:
        layout.label(text=group.legend_note, icon="INFO")
    column = layout.column(align=True)
    for line in group.legend:
        row = column.split(factor=0.68)
        row.label(text=line.name, icon_value=swatch(line.colour))
        area = row.row()
        area.alignment = "RIGHT"
        area.label(text=f"{line.area:.2f} m\u00b2")
