"""The capture-count curve, and the count at which a baseline reaches what refined has at the least."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from html import escape

from ..evaluation.arms import ARMS, REFINED
from .score_table import Row, strongest_of

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 560, 320, 56, 150, 20, 44
_COLOURS = dict(
    zip(ARMS, ("#88ccee", "#44aa99", "#999933", "#cc6677", "#aa4499", "#117733", "#332288", "#882255"), strict=True)
)
"""An arm's own, in every figure: of Paul Tol's muted scheme, which is told apart without red or green, too."""

_LEAST_SPAN_DB = 1.0
"""A chart spans at least this much, so that noise does not look like a cliff."""


def curves_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """The rows of each preset and scene that has several counts, by their arms and then counts."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((row.preset, row.scene), []).append(row)
    several = {key: own for key, own in found.items() if len({row.captures for row in own}) > 1}
    arms = list(dict.fromkeys(row.arm for row in rows))
    return {key: sorted(own, key=lambda row: (arms.index(row.arm), row.captures)) for key, own in several.items()}


def catching_up(rows: Sequence[Row]) -> str:
    """At which measured count the strongest baseline first reaches what refined has at its least; "" without both.

    Both by the seeds that they share: a count at which they share none is passed over.
    """
    refined = min((row for row in rows if row.arm == REFINED), key=lambda row: row.captures, default=None)
    if refined is None:
        return ""
    where, goal = f"{refined.scene}, {refined.preset}", f"{refined.spreads['psnr'].mean:.2f} dB"
    scored = 0
    for count in sorted({row.captures for row in rows}):
        best = strongest_of([row for row in rows if row.captures == count])
        shared = best.by_seed.keys() & refined.by_seed.keys() if best else ()
        if best is None or not shared:
            continue
        if best.mean_over(shared) >= refined.mean_over(shared):
            return (
                f"{where}: the strongest baseline reaches refined at {refined.captures} captures ({goal}) with {count}."
            )
        scored = count
    told = f"{where}: no baseline measured, up to {scored} captures, reaches refined at {refined.captures} ({goal})."
    return told if scored else ""


def curve_figure(rows: Sequence[Row]) -> str:
    """An SVG of the rows of one preset and scene: PSNR by captures, a line an arm, bars of one standard deviation.

    Lines join what was measured; in a scene without several seeds bars are the standard error over its views.
    """
    arms = list(dict.fromkeys(row.arm for row in rows))
    counts = sorted({row.captures for row in rows})
    values = [row.spreads["psnr"].mean for row in rows if math.isfinite(row.spreads["psnr"].mean)]
    if not values:
        return ""
    middle, span = (min(values) + max(values)) / 2.0, max(1.2 * (max(values) - min(values)), _LEAST_SPAN_DB)
    low, high = middle - span / 2.0, middle + span / 2.0

    def x(count: int) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * (count - counts[0]) / max(counts[-1] - counts[0], 1)

    def y(psnr: float) -> float:
        return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (high - min(max(psnr, low), high)) / (high - low)

    parts = [*_axes(counts, low, high, x, y)]
    for index, arm in enumerate(arms):
        colour = _COLOURS[arm]
        own = [row for row in rows if row.arm == arm and math.isfinite(row.spreads["psnr"].mean)]
        points = [(x(row.captures), y(row.spreads["psnr"].mean), row) for row in own]
        joined = " ".join(f"{across:.1f},{up:.1f}" for across, up, _ in points)
        parts.append(f'<polyline points="{joined}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        for across, up, row in points:
            mean, std = row.spreads["psnr"].mean, row.spreads["psnr"].std
            if spread := row.sem_db if std is None else std:
                parts.append(
                    f'<path d="M{across:.1f} {y(mean + spread):.1f}V{y(mean - spread):.1f}" stroke="{colour}"/>'
                )
            told = escape(f"{row.label}, {row.captures} captures: {mean:.2f} dB")
            parts.append(
                f'<circle cx="{across:.1f}" cy="{up:.1f}" r="4" fill="{colour}"><title>{told}</title></circle>'
            )
        if own:
            beside = _TOP + 18 * index + 6
            parts.append(
                f'<text x="{_WIDTH - _RIGHT + 22}" y="{beside + 4}">{escape(own[0].label)}</text>'
                f'<circle cx="{_WIDTH - _RIGHT + 12}" cy="{beside}" r="4" fill="{colour}"/>'
            )
    title = escape(f"{rows[0].scene}, {rows[0].preset}: PSNR by captures")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}" '
        f'role="img" font-family="sans-serif" font-size="12"><title>{title}</title>{"".join(parts)}</svg>\n'
    )


def _axes(
    counts: Sequence[int], low: float, high: float, x: Callable[[int], float], y: Callable[[float], float]
) -> Iterator[str]:
    step = next(step for step in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 1e9) if (high - low) / step <= 8)
    for index in range(math.ceil(low / step), math.floor(high / step) + 1):
        at = y(index * step)
        yield f'<line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="#e4e4e4"/>'
        yield f'<text x="{_LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">{index * step:.4g}</text>'
    for count in counts:
        yield f'<text x="{x(count):.1f}" y="{_HEIGHT - 24}" text-anchor="middle">{count}</text>'
    yield f'<text x="{(_LEFT + _WIDTH - _RIGHT) / 2:.1f}" y="{_HEIGHT - 6}" text-anchor="middle">captures</text>'
    yield f'<text x="{_LEFT - 8}" y="{_TOP - 6}" text-anchor="end">dB</text>'
