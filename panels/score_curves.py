"""The scores of a rollout's frames as curves at the bottom of the 3D view.

Where things lie is computed in ``bridge/view_chart.py``; what was made for the graphics card
is kept until the round, the rollout or the region's size changes.
"""

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..r2sego_blender.bridge.view_chart import Chart, chart_in, covered_margins, curve, stems
from ..r2sego_blender.bridge.view_scores import RoundScores, remembered_in
from .flat_shapes import rectangle, segments, text_width, write
from .overlays import Overlay

_BACKGROUND = (0.05, 0.05, 0.06, 0.72)
_COLOURS = {"u": (0.93, 0.42, 0.30, 1.0), "g": (0.25, 0.72, 0.74, 1.0), "s": (0.98, 0.90, 0.25, 1.0)}
_SURVIVOR, _TARGET = (1.0, 1.0, 1.0, 0.45), (0.90, 0.12, 0.35, 1.0)
_ACTIVE, _NOW = (1.0, 0.45, 0.05, 1.0), (0.45, 0.65, 1.0, 0.9)
_STEM, _TEXT_PX = 0.14, 11.0

_kept: dict[int, tuple] = {}
"""What was drawn last in each area of the screen, and of what it was made."""

_MOST_KEPT = 16  # areas that were closed are not told apart from those that are there


def register() -> None:
    """Start drawing."""
    _overlay.register()


def unregister() -> None:
    """Stop drawing, and forget what was drawn."""
    _overlay.unregister()
    _kept.clear()


def shown_chart(context) -> Chart | None:
    """Where the curves lie in the 3D view of ``context``, None when they are not shown."""
    made = _shown(context)
    return None if made is None else made[0]


def _shown(context) -> tuple[Chart, list, list] | None:
    """What is drawn in the 3D view of ``context``; made anew only when something has changed."""
    group, scores = context.scene.r2sego_views, remembered_in(context.scene)
    if scores is None or not group.curves or not context.space_data.overlay.show_overlays:
        return None
    region, scale = context.region, context.preferences.system.ui_scale
    others = [other for other in context.area.regions if other.type != "WINDOW"]
    size, margins = (region.width, region.height), covered_margins(region, others)
    key = (scores.number, group.rollout, size, margins, scale)
    place = context.area.as_pointer()
    if place not in _kept or _kept[place][0] != key:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        _kept[place] = key, _made(scores, group.rollout, size, margins, scale)
    return _kept[place][1]


def _draw(context) -> None:
    made = _shown(context)
    if made is None:
        return
    group, scores = context.scene.r2sego_views, remembered_in(context.scene)
    scale = context.preferences.system.ui_scale
    chart, batches, title = made
    edge = 5.0 * scale
    rectangle(
        chart.left - edge, chart.bottom - edge, chart.width + 2 * edge,
        chart.height + (_TEXT_PX + 8.0) * scale + edge, _BACKGROUND,
    )  # fmt: skip
    _draw_batches(batches, scale)
    now, active = context.scene.frame_current, group.active
    if chart.first <= now <= chart.last:
        segments(stems(chart, np.array([now]), 1.0), _NOW, 1.5 * scale)
    if 0 <= active < len(scores) and scores.views.rollout[active] == group.rollout:
        segments(stems(chart, np.array([group.active_frame]), 1.0), _ACTIVE, 2.0 * scale)
    x, y = chart.left, chart.bottom + chart.height + 4.0 * scale
    for text, colour in title:
        width = text_width(text, _TEXT_PX * scale)
        if x + width > chart.left + chart.width:
            break  # a narrow view has room for the first words alone
        write(text, x, y, colour, _TEXT_PX * scale)
        x += width + 12.0 * scale


def _made(
    scores: RoundScores,
    rollout: int,
    size: tuple[int, int],
    margins: tuple[float, float, float],
    scale: float,
) -> tuple[Chart, list, list] | None:
    """The chart, its batches with colour and width, and the words above it."""
    members, views = scores.of_rollout(rollout), scores.views
    frames = views.frame[members]
    chart = chart_in(size, margins, scale, frames)
    if chart is None:
        return None
    drawn = [
        (stems(chart, frames[views.survived[members]], _STEM), _SURVIVOR, 1.5),
        (stems(chart, frames[views.chosen[members]], 1.0), _TARGET, 2.0),
        (curve(chart, frames, views.deficit[members]), _COLOURS["u"], 1.5),
        (curve(chart, frames, views.availability[members]), _COLOURS["g"], 1.5),
        (curve(chart, frames, views.score[members] / scores.best_score), _COLOURS["s"], 2.0),
    ]
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batches = [
        (batch_for_shader(shader, "LINES", {"pos": np.pad(points, ((0, 0), (0, 1)))}), colour, width)
        for points, colour, width in drawn
        if len(points)
    ]
    title = [
        (f"Rollout {rollout}, frames {chart.first} to {chart.last}", (1.0, 1.0, 1.0, 0.9)),
        ("u deficit", _COLOURS["u"]),
        ("g availability", _COLOURS["g"]),
        (f"s score (top = {scores.best_score:.3f})", _COLOURS["s"]),
        ("targets", _TARGET),
        ("survivors", _SURVIVOR),
        ("now", _NOW),
    ]
    return chart, batches, title


def _draw_batches(batches: list, scale: float) -> None:
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    for batch, colour, width in batches:
        shader.uniform_float("lineWidth", width * scale)
        shader.uniform_float("color", colour)
        batch.draw(shader)
    gpu.state.blend_set("NONE")


_overlay = Overlay(_draw, "POST_PIXEL")
