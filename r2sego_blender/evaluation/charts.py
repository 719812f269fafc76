"""Charts as inline SVG; their colours come from the report's style sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from .report_data import CandidateCurves, ScoredRound

WIDTH, HEIGHT = 960, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 36, 8, 12, 26
_MOST_POINTS = 480
"""More candidates than this are drawn as the maximum of neighbouring ones."""

_ROUNDS_WIDTH, _ROUNDS_HEIGHT = 480, 200
_LEAST_SPAN_DB = 0.5
"""A chart of rounds spans at least this much, so that noise does not look like a cliff."""


def candidate_chart(curves: CandidateCurves) -> Markup:
    """u, g and s along the candidate stream, rollout borders, and the chosen targets."""
    count = len(curves.score)
    if count == 0:
        return Markup("")
    parts = [_grid(), *_rollout_borders(curves.rollout)]
    parts.append(_area(curves.score))
    for name, values in (("g", curves.availability), ("u", curves.deficit), ("s", curves.score)):
        parts.append(f'<polyline class="curve {name}" points="{_points(values)}"/>')
    for index in np.asarray(curves.chosen, int):
        x, y = _x(index, count), _y(float(curves.score[index]))
        parts.append(f'<line class="target" x1="{x:.1f}" x2="{x:.1f}" y1="{y:.1f}" y2="{_y(0):.1f}"/>')
        parts.append(f'<circle class="target" cx="{x:.1f}" cy="{y:.1f}" r="4"/>')
    label = (
        f"Scores of {count} candidate views: asset deficit u, geometry availability g and their product s; "
        f"{len(curves.chosen)} chosen, the best s is {float(curves.score.max()):.2f}."
    )
    body = "".join(parts)
    return Markup(f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">{body}</svg>')


def round_chart(rounds: Sequence[ScoredRound]) -> Markup:
    """PSNR by round as a line; a round with a mark is drawn apart. Nothing for a single one."""
    scored = [(one, one.psnr) for one in rounds if one.psnr is not None and math.isfinite(one.psnr)]
    if len(scored) < 2:
        return Markup("")
    values = [psnr for _, psnr in scored]
    middle, span = (min(values) + max(values)) / 2, max(max(values) - min(values), _LEAST_SPAN_DB)
    step = (_ROUNDS_WIDTH - 2 * _LEFT) / (rounds[-1].number - rounds[0].number)
    places = [
        (_LEFT + step * (one.number - rounds[0].number), _ROUNDS_HEIGHT * (0.48 - 0.5 * (psnr - middle) / span))
        for one, psnr in scored
    ]
    parts = [f'<polyline class="curve s" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}"/>']
    for (one, psnr), (x, y) in zip(scored, places, strict=True):
        kind = "point fell" if one.mark else "point"
        parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="5"/>')
        parts.append(_tick(x, y - 11.0, f"{psnr:.2f}"))
        parts.append(_tick(x, _ROUNDS_HEIGHT - 6.0, f"round {one.number}"))
    told = ", ".join(f"round {one.number} {psnr:.2f}" for one, psnr in scored)
    return Markup(
        f'<svg class="chart" viewBox="0 0 {_ROUNDS_WIDTH} {_ROUNDS_HEIGHT}" role="img" '
        f'aria-label="PSNR in dB by round: {told}.">{"".join(parts)}</svg>'
    )


def _tick(x: float, y: float, words: str) -> str:
    return f'<text class="tick" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{words}</text>'


def _x(index: float, count: int) -> float:
    return _LEFT + (WIDTH - _LEFT - _RIGHT) * (index + 0.5) / count


def _y(value: float) -> float:
    return _TOP + (HEIGHT - _TOP - _BOTTOM) * (1.0 - float(np.clip(value, 0.0, 1.0)))


def _grid() -> str:
    lines = []
    for value in (0.0, 0.5, 1.0):
        y = _y(value)
        lines.append(f'<line class="grid" x1="{_LEFT}" x2="{WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        lines.append(f'<text class="tick" x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    return "".join(lines)


def _rollout_borders(rollout: np.ndarray) -> list[str]:
    """A thin line where the stream passes to the next rollout, and the rollouts' numbers."""
    count = len(rollout)
    starts = np.flatnonzero(np.r_[True, rollout[1:] != rollout[:-1]])
    marks = []
    for start, end in zip(starts, [*starts[1:], count], strict=True):
        x = _x(start - 0.5, count)
        if start:
            marks.append(f'<line class="border" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP}" y2="{_y(0):.1f}"/>')
        middle = _x((start + end - 1) / 2, count)
        if (end - start) / count > 0.02:
            place = f'x="{middle:.1f}" y="{HEIGHT - 8}" text-anchor="middle"'
            marks.append(f'<text class="tick" {place}>{int(rollout[start])}</text>')
    return marks


def _points(values: np.ndarray) -> str:
    """The polyline of a curve, thinned to what a screen can show."""
    values = np.asarray(values, np.float64)
    count = len(values)
    edges = np.unique(np.linspace(0, count, min(count, _MOST_POINTS) + 1).astype(int))
    peaks = np.maximum.reduceat(values, edges[:-1])
    middles = (edges[:-1] + edges[1:] - 1) / 2
    return " ".join(f"{_x(i, count):.1f},{_y(v):.1f}" for i, v in zip(middles, peaks, strict=True))


def _area(values: np.ndarray) -> str:
    points = _points(values)
    first, last = points.split(" ", 1)[0].split(",")[0], points.rsplit(" ", 1)[-1].split(",")[0]
    return f'<polygon class="area" points="{first},{_y(0):.1f} {points} {last},{_y(0):.1f}"/>'
