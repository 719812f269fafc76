"""The scores of a rollout's frames as curves at the bottom of the 3D view.

Where things lie is computed in ``results/panels/view_chart.py``; the curves and words are drawn once, into a
picture that is kept until the round, the rollout or the region's size changes.
"""

from functools import cached_property

from ...r2sego_blender.results.panels.view_chart import Chart, chart_in, covered_margins, curve, stems
from ...r2sego_blender.results.panels.view_scores import RoundScores
from .flat_shapes import rectangle, segments, text_width, write
from .kept_pictures import KeptPicture
from .overlay import Overlay
from .textures import forget_shader

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
    forget_shader()


class _Curves:
    """A rollout's chart, and the picture of it, drawn when a view draws it first."""

    def __init__(self, chart: Chart, scores: RoundScores, rollout: int, scale: float) -> None:
        self.chart = chart
        self._scores, self._rollout, self._scale = scores, rollout, scale

    @cached_property
    def picture(self) -> KeptPicture:
        """The curves on their ground, with the words above."""
        chart, scale = self.chart, self._scale
        edge = 5.0 * scale
        picture = KeptPicture(
            chart.left - edge,
            chart.bottom - edge,
            chart.width + 2 * edge,
            chart.height + (_TEXT_PX + 8.0) * scale + edge,
        )
        with picture.drawing():
            rectangle(*picture.place, _BACKGROUND)
            _draw_lines(chart, self._scores, self._rollout, scale)
            _draw_title(chart, _title(chart, self._scores, self._rollout), scale)
        return picture


def shown_chart(context) -> Chart | None:
    """Where the curves lie in the 3D view of ``context``, None when they are not shown."""
    curves = _shown(context)
    return None if curves is None else curves.chart


def _shown(context) -> _Curves | None:
    """What is drawn in the 3D view of ``context``; made anew only when something has changed."""
    group, scores = context.scene.r2sego_views, context.scene.r2sego_views.scores
    if scores is None or not group.curves or not context.space_data.overlay.show_overlays:
        return None
    region, scale = context.region, context.preferences.system.ui_scale
    others = [other for other in context.area.regions if other.type != "WINDOW"]
    size, margins = (region.width, region.height), covered_margins(region, others)
    key = (group.rollout, size, margins, scale)
    place = context.area.as_pointer()
    if place not in _kept or _kept[place][0] is not scores or _kept[place][1] != key:
        if len(_kept) >= _MOST_KEPT:
            _kept.clear()
        chart = chart_in(size, margins, scale, scores.selection.frame[scores.of_rollout(group.rollout)])
        curves = None if chart is None else _Curves(chart, scores, group.rollout, scale)
        _kept[place] = scores, key, curves
    return _kept[place][2]


def _draw(context) -> None:
    curves = _shown(context)
    if curves is None:
        return
    curves.picture.draw()
    group, scores = context.scene.r2sego_views, context.scene.r2sego_views.scores
    scale = context.preferences.system.ui_scale
    chart, now, active = curves.chart, context.scene.frame_current, group.active
    if chart.first <= now <= chart.last:
        _mark(chart, now, _NOW, 1.5 * scale)
    if 0 <= active < len(scores) and scores.selection.rollout[active] == group.rollout:
        _mark(chart, group.active_frame, _ACTIVE, 2.0 * scale)


def _mark(chart: Chart, frame: int, colour: tuple[float, float, float, float], width_px: float) -> None:
    """An upright line through a frame."""
    rectangle(chart.x_of(frame) - 0.5 * width_px, chart.bottom, width_px, chart.height, colour)


def _draw_lines(chart: Chart, scores: RoundScores, rollout: int, scale: float) -> None:
    members, views = scores.of_rollout(rollout), scores.selection
    frames = views.frame[members]
    drawn = [
        (stems(chart, frames[views.survived[members]], _STEM), _SURVIVOR, 1.5),
        (stems(chart, frames[views.chosen[members]], 1.0), _TARGET, 2.0),
        (curve(chart, frames, views.deficit[members]), _COLOURS["u"], 1.5),
        (curve(chart, frames, views.availability[members]), _COLOURS["g"], 1.5),
        (curve(chart, frames, views.score[members] / scores.best_score), _COLOURS["s"], 2.0),
    ]
    for points, colour, width in drawn:
        segments(points, colour, width * scale)


def _title(chart: Chart, scores: RoundScores, rollout: int) -> list[tuple[str, tuple]]:
    """The words above the curves and their colours."""
    return [
        (f"Rollout {rollout}, frames {chart.first} to {chart.last}", (1.0, 1.0, 1.0, 0.9)),
        ("u deficit", _COLOURS["u"]),
        ("g availability", _COLOURS["g"]),
        (f"s score (top = {scores.best_score:.3f})", _COLOURS["s"]),
        ("targets", _TARGET),
        ("survivors", _SURVIVOR),
        ("now", _NOW),
    ]


def _draw_title(chart: Chart, title: list[tuple[str, tuple]], scale: float) -> None:
    x, y = chart.left, chart.bottom + chart.height + 4.0 * scale
    for text, colour in title:
        width = text_width(text, _TEXT_PX * scale)
        if x + width > chart.left + chart.width:
            break  # a narrow view has room for the first words alone
        write(text, x, y, colour, _TEXT_PX * scale)
        x += width + 12.0 * scale


_overlay = Overlay(_draw, "POST_PIXEL")
