"""The figure of a study: each policy's success rate, pairs of one seed joined, means with their deviation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from .counts import PolicyCount
from .success_table import SuccessTable

_WIDTH_OF, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 150, 300, 52, 16, 16, 40
_JITTER, _MOST_ASIDE = 9.0, 36.0
_COLOURS = ("#a33", "#274", "#247", "#752")


def success_figure(counts: Sequence[PolicyCount]) -> str:
    """An SVG: a column a condition, a point a policy; policies of one seed are joined."""
    table = SuccessTable.of(counts)
    width = _LEFT + _RIGHT + _WIDTH_OF * len(table.rows)
    seeds = list(dict.fromkeys(count.policy.seed for count in counts))
    places = {}
    for column, row in enumerate(table.rows):
        for seed, successes, trials in row.by_seed:
            if trials:  # a little apart, so that equal ones are seen
                aside = min(_JITTER, 2 * _MOST_ASIDE / len(seeds)) * (seeds.index(seed) - (len(seeds) - 1) / 2)
                places[column, seed] = (_middle(column) + aside, _y(successes / trials), successes, trials)
    parts = [_axis(width)]
    for (column, seed), (x, y, _, _) in places.items():
        if (column + 1, seed) in places:
            after = places[column + 1, seed]
            parts.append(f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{after[0]:.1f}" y2="{after[1]:.1f}" stroke="#bbb"/>')
    for column, row in enumerate(table.rows):
        colour = _COLOURS[column % len(_COLOURS)]
        parts.append(
            f'<text x="{_middle(column):.1f}" y="{_HEIGHT - 14}" text-anchor="middle">{escape(row.condition)}</text>'
        )
        if row.real:
            mean = float(row.real.mean)
            x, deviation = _middle(column) + 46, math.sqrt(row.real.variance or 0)
            high, low = _y(min(mean + deviation, 1.0)), _y(max(mean - deviation, 0.0))
            parts.append(f'<path d="M{x:.1f} {high:.1f}V{low:.1f}" stroke="{colour}" stroke-width="2"/>')
            parts.append(f'<path d="M{x - 8:.1f} {_y(mean):.1f}h16" stroke="{colour}" stroke-width="3"/>')
    for (column, seed), (x, y, successes, trials) in places.items():
        parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="{_COLOURS[column % len(_COLOURS)]}">'
            f"<title>seed {seed}: {successes}/{trials}</title></circle>"
        )
    told = " ".join(table.notes())
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {_HEIGHT}" width="{width}" height="{_HEIGHT}" '
        f'role="img" font-family="sans-serif" font-size="12"><title>Success on the robot by policy</title>'
        f"<desc>{escape(told)}</desc>{''.join(parts)}</svg>\n"
    )


def _axis(width: int) -> str:
    lines = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _y(share)
        lines.append(f'<line x1="{_LEFT}" y1="{y:.1f}" x2="{width - _RIGHT}" y2="{y:.1f}" stroke="#e4e4e4"/>')
        lines.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{100 * share:.0f}</text>')
    middle = _y(0.5)
    lines.append(
        f'<text transform="translate(14 {middle:.1f}) rotate(-90)" text-anchor="middle">successful trials (%)</text>'
    )
    return "".join(lines)


def _middle(column: int) -> float:
    return _LEFT + _WIDTH_OF * (column + 0.45)


def _y(share: float) -> float:
    return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (1.0 - share)
