"""One page of an experiment that holds all it shows: tables, curves, and each arm's pictures beside the photographs."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
from markupsafe import Markup

from ..core.atomic_files import write_whole
from ..core.formatting import counted
from ..core.printable import printable
from ..evaluation.arms import ARMS
from ..evaluation.report import page_environment
from ..evaluation.report_data import Picture
from ..evaluation.surfaces.figures import unseen_told
from .capture_curve import curve_figure
from .cells import Cell, Group
from .datasets.dataset import Published
from .datasets.published import title_of
from .page_pictures import MOST_BYTES, ShownCell, shown_cells, within_bound
from .records import Record
from .score_table import Row, Spread, about, spread_told, tables_of

PAGE = "page.html"

_TEMPLATES = Path(__file__).with_name("templates")
_SCRIPT = "comparison.js"


@dataclass(frozen=True)
class Cost:
    """What a preset's cells of one scene and count took: the head's words, in the order of the columns, and the mean
    seconds of each step."""

    scene: str
    captures: int
    preset: str
    cells: int
    stages: Mapping[str, str]
    steps: Mapping[str, float]


@dataclass(frozen=True)
class Section:
    """A cell's part of the page: its anchor and title, what is said of it, and the arm that the viewer begins with."""

    key: str
    title: str
    told: str
    shown: ShownCell
    arm: str


def write_page(
    folder: Path,
    done: Sequence[tuple[Cell, Record]],
    cells: int,
    rows: Sequence[Row],
    curves: Sequence[Sequence[Row]],
    notes: Sequence[str],
    published: Published | None = None,
) -> Path:
    """Write ``folder/page.html``, which loads nothing: of the cells ``done``, of so many, and their tables, with
    what others have ``published``.

    The same bytes for the same records and bundles. Raises OSError.
    """
    shown, uris = within_bound(shown_cells(done))

    def source(picture: Picture, *_words: object) -> str:
        return Markup(uris.get(picture, "")) if isinstance(picture, Path) else ""

    environment = page_environment(source, source, _TEMPLATES)
    script = _source_of(environment, _SCRIPT)
    html = environment.get_template("page.html.j2").render(
        title=printable(folder.name),
        about=f"{len(done)} of {counted(cells, 'cell')} done",
        tables=list(tables_of(rows)),
        notes=[*about(rows), *notes],
        published=published,
        published_title=title_of(published) if published else "",
        curves=[Markup(curve_figure(own)) for own in curves],
        sections=[_section(index, one) for index, one in enumerate(shown)],
        labels={arm: source.label for arm, source in ARMS.items()},
        costs=list(_costs(done)),
        most_mb=MOST_BYTES >> 20,
        script=Markup(script),
        script_sha256=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )
    write_whole(folder / PAGE, html)
    return folder / PAGE


def _section(index: int, one: ShownCell) -> Section:
    cell, last = one.cell, one.arms[-1]
    told = [f"Seed {cell.seed}", f"{counted(len(one.frozen), 'frozen view')}, worst first by {ARMS[last].label}"]
    told += filter(None, [unseen_told(one.record.arms[last])])
    if one.left_out:
        told.append(
            f"the best {one.left_out} of the views are left out, so that all pictures of this page stay within "
            f"{MOST_BYTES >> 20} MiB"
        )
    return Section(
        f"views-{index}",
        f"{cell.scene.name}, {counted(cell.captures, 'capture')}, {cell.preset.name}",
        f"{'. '.join(part[0].upper() + part[1:] for part in told)}.",
        one,
        last,
    )


def _costs(done: Sequence[tuple[Cell, Record]]) -> Iterator[Cost]:
    """Of the cells of each group: seconds and memory of their commands, and seconds of their steps."""
    groups: dict[Group, list[Record]] = {}
    for cell, record in done:
        groups.setdefault(cell.group, []).append(record)
    for (preset, scene, captures), records in groups.items():
        names = dict.fromkeys(stage.name for record in records for stage in record.stages)
        stages = {}
        for name in names:
            own = [stage for record in records for stage in record.stages if stage.name == name]
            peaks = [stage.peak_mb for stage in own if stage.peak_mb is not None]
            memory = f", {max(peaks):.0f} MB" if peaks else ""
            stages[name] = f"{spread_told(Spread.of([stage.seconds for stage in own]), 1)} s{memory}"
        steps = {
            step: sum(record.steps.get(step, 0.0) for record in records) / len(records)
            for step in dict.fromkeys(step for record in records for step in record.steps)
        }
        yield Cost(scene, captures, preset, len(records), stages, steps)


def _source_of(environment: jinja2.Environment, name: str) -> str:
    assert environment.loader is not None
    return environment.loader.get_source(environment, name)[0]
