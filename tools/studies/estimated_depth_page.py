"""The study's tables and figure in docs/: what an estimate of depth is worth by its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from .disturbed_depth import KINDS

Figures = Mapping[str, Any]

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE, FIGURE = Path("estimated-depth.md"), Path("pictures/estimated_depth.svg")
BEGIN, END = "<!-- made by tools/studies/estimated_depth.py -->", "<!-- end of what was made -->"

_HEADINGS = (
    "estimate",
    "AbsRel",
    "itself within 5 (10) %",
    "completed within 5 (10) %",
    "best choice",
    "F-score (precision, recall)",
    "unseen within 1, 2, 3 sigma",
    "PSNR / SSIM",
)
_PANELS = ("completed depth within 5 %", "F-score of the proxy at 5 cm", "PSNR on frozen views, dB")
_COLOURS = dict(zip(KINDS, ("#7f7f7f", "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728"), strict=True))
_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _BOTTOM = 300, 220, 44, 30, 12, 34


def line(figures: Figures) -> str:
    """A point's figures as a line for a terminal."""
    cells = zip(_HEADINGS[1:], _cells(figures)[1:], strict=True)
    told = [f"{heading} {cell}" for heading, cell in cells if cell]
    return f"{figures['scene']}, {_cells(figures)[0]}: {'; '.join(told)}"


def tables(points: Sequence[Figures]) -> str:
    """A Markdown table a scene, seeds averaged, with when and where each was made."""
    text = []
    for scene, its in groupby(_averaged(points), key=lambda one: one["scene"]):
        rows = list(its)
        made = dict.fromkeys(one["made"] for one in rows)
        text += [f"`{scene}`; made on {'; '.join(made)}:", ""]
        text += [f"| {' | '.join(_HEADINGS)} |", f"|{' --- |' * len(_HEADINGS)}"]
        text += [f"| {' | '.join(_cells(one))} |" for one in rows]
        text.append("")
    return "\n".join(text).rstrip()


def figure(points: Sequence[Figures]) -> str:
    """The same as an SVG: of each scene a row of panels over the mean relative error, dashed what there is without."""
    averaged = _averaged(points)
    scenes = list(dict.fromkeys(one["scene"] for one in averaged))
    panels = [
        f'<g transform="translate({_WIDTH * column} {_HEIGHT * row})">{_panel(averaged, scene, column)}</g>'
        for row, scene in enumerate(scenes)
        for column in range(len(_PANELS))
    ]
    height, width = _HEIGHT * len(scenes) + 24, _WIDTH * len(_PANELS)
    legend = "".join(
        f'<text x="{_LEFT + 90 * index}" y="{height - 8}" fill="{colour}">{kind}</text>'
        for index, (kind, colour) in enumerate(_COLOURS.items())
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>{"".join(panels)}{legend}</svg>\n'
    )


def write_page(points: Sequence[Figures], docs: Path = DOCS) -> None:
    """Put the tables between the page's markers, and the figure beside. Raises ValueError for a page without them."""
    page = docs / PAGE
    head, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"{page}: there are no '{BEGIN}' and '{END}' to put the tables between")
    page.write_text(f"{head}{BEGIN}\n\n{tables(points)}\n\n{END}{tail}", encoding="utf-8")
    (docs / FIGURE).write_text(figure(points), encoding="utf-8")


def _averaged(points: Sequence[Figures]) -> list[dict[str, Any]]:
    """One a scene, kind and error in the order of the tables; numbers are the seeds' means."""

    def place(one: Figures) -> tuple[str, int, float]:
        return one["scene"], (*KINDS, "none")[::-1].index(one["kind"]), one["error"]

    return [_mean(list(same)) for _, same in groupby(sorted(points, key=place), key=place)]


def _mean(same: Sequence[Any]) -> Any:
    first = same[0]
    if isinstance(first, Mapping):
        return {key: _mean([one[key] for one in same if key in one]) for key in first}
    return float(np.mean(same)) if isinstance(first, float) else first


def _cells(one: Figures) -> list[str]:
    given, estimate, views = one.get("given"), one.get("estimate"), one.get("views")
    told = [f"{one['kind']}, {one['error']:.0%}" if given else "none", f"{given['absrel']:.1%}" if given else ""]
    if "refused" in one:
        return [*told, "", "refused", *[""] * (len(_HEADINGS) - 4)]
    completed, proxy = one["completed"], one.get("proxy")
    unseen = estimate["unseen"] if estimate else {}
    sigmas = [f"{100 * unseen[f'within_{count}']:.0f}" for count in (1, 2, 3) if f"within_{count}" in unseen]
    return [
        *told,
        _share(estimate) if estimate else "",
        _share(completed),
        _share(one["best"]) if "best" in one else "",
        f"{100 * proxy['fscore']:.1f} ({100 * proxy['precision']:.1f}, {100 * proxy['recall']:.1f})" if proxy else "",
        ", ".join(sigmas),
        f"{views['psnr']:.2f} / {views['ssim']:.3f}" if views else "",
    ]


def _share(shares: Figures) -> str:
    return f"{100 * shares['within_5_percent']:.1f} ({100 * shares['within_10_percent']:.1f})"


def _panel(points: Sequence[Figures], scene: str, column: int) -> str:
    its = [one for one in points if one["scene"] == scene and _shown(one, column)]
    values = [_value(one, column) for one in its]
    parts = [f'<text x="{_LEFT}" y="18">{escape(scene)}: {escape(_PANELS[column])}</text>']
    if not its:
        return "".join(parts)
    low, high = min(values), max(values)
    low, high = low - 0.05 * (high - low) - 1e-6, high + 0.05 * (high - low) + 1e-6
    farthest = max((one["error"] for one in its), default=0.0) or 1.0

    def at(error: float, value: float) -> tuple[float, float]:
        return (
            _LEFT + (_WIDTH - _LEFT - _RIGHT) * error / farthest,
            _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * (value - low) / (high - low),
        )

    for value in np.linspace(low, high, 4):
        _, y = at(0.0, value)
        parts.append(f'<path d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{_LEFT - 4}" y="{y + 4:.1f}" text-anchor="end">{value:.1f}</text>')
    for error in sorted({one["error"] for one in its}):
        x, _ = at(error, low)
        parts.append(f'<text x="{x:.1f}" y="{_HEIGHT - _BOTTOM + 16}" text-anchor="middle">{error:.0%}</text>')
    for kind, colour in {"none": "black", **_COLOURS}.items():
        places = [at(one["error"], _value(one, column)) for one in its if one["kind"] == kind]
        if kind == "none" and places:
            places = [places[0], (float(_WIDTH - _RIGHT), places[0][1])]
        drawn = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        dashes = ' stroke-dasharray="5 4"' if kind == "none" else ""
        parts.append(f'<polyline points="{drawn}" fill="none" stroke="{colour}"{dashes}/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in places if kind != "none"]
    return "".join(parts)


def _shown(one: Figures, column: int) -> bool:
    return "refused" not in one and ("completed", "proxy", "views")[column] in one


def _value(one: Figures, column: int) -> float:
    if column == 2:
        return float(one["views"]["psnr"])
    return 100.0 * float(one["proxy"]["fscore"] if column else one["completed"]["within_5_percent"])
