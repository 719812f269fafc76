"""What an experiment's records come to: ``metrics.json``, tables, and the capture-count curve, in its folder."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from ..core.formatting import counted
from ..evaluation.arms import ARMS
from ..evaluation.surfaces.figures import SEEN_BY
from .capture_curve import catching_up, curve_figure, curves_of
from .cells import Cell
from .datasets.published import published_latex, published_markdown, published_of
from .page import write_page
from .plan import Plan
from .records import Record, score_of
from .score_table import ALL_SCENES, KINDS, Measured, latex, markdown, rows_of, worth_of_views

METRICS, MARKDOWN, LATEX, FIGURES = "metrics.json", "tables.md", "tables.tex", "figures"


def gather(plan: Plan, cells: Sequence[Cell], records: Mapping[Path, Record], folder: Path) -> None:
    """Write everything that the ``records`` of the plan's ``cells`` say, by the cells' folders, into ``folder``.

    The same bytes for the same records, whatever was done first. Raises OSError.
    """
    done = [(cell, records[cell.folder]) for cell in cells if cell.folder in records]
    entries = [entry for cell, record in done for entry in _entries(cell, record)]
    write_whole(folder / METRICS, json.dumps({"cells": entries}, indent=1, sort_keys=True, allow_nan=False) + "\n")
    rows = rows_of([one for cell, record in done for one in _measured(cell, record)])
    curves = curves_of(rows)
    notes = [
        *worth_of_views(rows),
        *filter(None, map(catching_up, curves.values())),
        *_unseen(done),
        *_frozen(plan, cells),
        *_of_others(done),
        *_made_by(done),
    ]
    if missing := len(cells) - len(done):
        notes.append(f"Incomplete: {counted(missing, 'cell')} of {len(cells)} not done, and in no figure.")
    write_whole(folder / MARKDOWN, markdown(rows, notes) + published_markdown(plan.published))
    write_whole(folder / LATEX, latex(rows, notes) + published_latex(plan.published))
    (folder / FIGURES).mkdir(exist_ok=True)
    for (preset, scene), own in curves.items():
        of = preset if scene == ALL_SCENES else f"{preset}+{scene}"  # names have no +: no two curves have one file
        write_whole(folder / FIGURES / f"captures-{of}.svg", curve_figure(own))
    write_page(folder, done, len(cells), rows, [*curves.values()], notes, published_of(plan.published))


def _measured(cell: Cell, record: Record) -> Iterator[Measured]:
    for arm, scored in record.arms.items():
        scores = {kind: value for kind in KINDS if (value := score_of(scored, kind)) is not None}
        views = {view["name"]: value for view in scored["views"] if (value := score_of(view, "psnr")) is not None}
        yield Measured(cell.preset.name, cell.scene.name, cell.captures, cell.seed, arm, scores, views)


def _entries(cell: Cell, record: Record) -> Iterator[dict[str, Any]]:
    """What ``metrics.json`` says of each arm of a cell."""
    common = {
        "scene": cell.scene.name,
        "captures": cell.captures,
        "preset": cell.preset.name,
        "settings": {"preset": cell.preset.preset, "overrides": dict(cell.preset.overrides)},
        "seed": cell.seed,
        "key": record.key,
        "frozen_sha256": cell.inputs.frozen_sha256,
        "seconds": round(record.seconds, 3),
        "peak_mb": record.peak_mb,
        "stages": [vars(stage) for stage in record.stages],
        "steps": dict(record.steps),
        "assets": dict(record.assets),
        "made_by": dict(record.made_by),
        "finished": record.finished,
    }
    for arm, scored in sorted(record.arms.items()):
        yield {**common, "arm": arm, **scored}


def _unseen(done: Sequence[tuple[Cell, Record]]) -> Iterator[str]:
    """The share of the frozen views' pixels that no capture saw, by counts, and by what that was told."""
    found: dict[tuple[str, str, str], dict[int, list[float]]] = {}
    for cell, record in done:
        for arm in list(record.arms.values())[:1]:  # the same for all
            if (share := arm.get("unseen")) is not None:
                place = found.setdefault((cell.scene.name, cell.preset.name, arm.get(SEEN_BY, "")), {})
                place.setdefault(cell.captures, []).append(share)
    for (scene, preset, told_by), counts in found.items():
        shares = ", ".join(
            f"{sum(own) / len(own):.1%} with {counted(count, 'capture')}" for count, own in sorted(counts.items())
        )
        yield f"{scene}, {preset}: no capture saw {shares} of the frozen views' pixels, told by {told_by}."


def _frozen(plan: Plan, cells: Sequence[Cell]) -> Iterator[str]:
    """The frozen lists, fixed before anything ran."""
    inputs = {cell.scene.name: cell.inputs for cell in cells}
    for scene in plan.scenes:
        of_scene = inputs[scene.name]
        yield f"{scene.name}: {counted(len(of_scene.frozen), 'frozen view')}, SHA-256 {of_scene.frozen_sha256}."


def _of_others(done: Sequence[tuple[Cell, Record]]) -> Iterator[str]:
    """What ran in an environment of its own, and what was asked for and could not be run."""
    backends = {
        (arm, scored["backend"]) for _, record in done for arm, scored in record.arms.items() if "backend" in scored
    }
    for arm, backend in sorted(backends):
        yield f"{ARMS[arm].label}: {backend}."
    without = Counter(pair for _, record in done for pair in record.not_scored.items())
    for (arm, why), cells in sorted(without.items()):
        yield f"{ARMS[arm].label} was not run in {cells} of {counted(len(done), 'cell')}: {why}"


def _made_by(done: Sequence[tuple[Cell, Record]]) -> Iterator[str]:
    """Every version, commit and machine that made some of it."""
    for key in ("version", "commit", "processor", "system"):
        if values := sorted({record.made_by.get(key, "") for _, record in done} - {""}):
            yield f"{key.capitalize()}: {', '.join(values)}."
