"""Scores of arms over seeds and views, paired differences, and their tables as Markdown and LaTeX.

The seed is the replicate: means and sample standard deviations are over seeds, differences are of the arms of one seed,
and Student's interval is of these. Over the views of one scene there is a standard error of the mean. What was not
measured is in no figure, and nothing is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..bundle.figures import BASELINES
from ..core.formatting import latex_text, markdown_text
from ..core.statistics import CONFIDENCE, Interval, student_interval
from ..evaluation.arms import ARMS, REFINED, WITHOUT_GENERATED, strongest_baseline
from ..evaluation.surfaces.figures import RIGHT_DEPTH, SURFACE_TOLERANCE_M
from .records import MEASURED_KINDS, PICTURE_KINDS

KINDS = (*PICTURE_KINDS, *MEASURED_KINDS)
ALL_SCENES = "all scenes"

Scores = Mapping[str, float]
"""By kind, of one arm and seed."""


@dataclass(frozen=True)
class Spread:
    """The mean over seeds and their sample standard deviation, None of a single one."""

    mean: float
    std: float | None

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """Of one value at least."""
        spread = float(np.std(values, ddof=1)) if len(values) > 1 and np.isfinite(values).all() else None
        return Spread(float(np.mean(values)), spread)


@dataclass(frozen=True)
class Difference:
    """The mean of paired differences in dB to the row named ``to``, and Student's interval from two pairs on."""

    to: str
    mean: float
    interval: Interval | None
    pairs: int

    @staticmethod
    def of(to: str, values: Mapping[int, float], others: Mapping[int, float]) -> Difference | None:
        """Of values by seed; None where no seed has both, or of equal images."""
        apart = [values[seed] - others[seed] for seed in values if seed in others]
        if not apart or not np.isfinite(apart).all():
            return None
        return Difference(to, float(np.mean(apart)), student_interval(apart) if len(apart) > 1 else None, len(apart))


@dataclass(frozen=True)
class Measured:
    """One arm of a cell: what was scored with one seed. A PSNR of equal images is infinite; ``views`` in dB by name."""

    preset: str
    scene: str
    captures: int
    seed: int
    arm: str
    scores: Scores
    views: Mapping[str, float]


@dataclass(frozen=True)
class Row:
    """One arm of a scene, or of all, with a count of captures and a preset, over seeds.

    ``by_seed`` is its PSNR; ``sem_db`` is the standard error of PSNR over the scene's ``views``, each averaged over
    seeds first.
    """

    preset: str
    scene: str
    captures: int
    arm: str
    spreads: Mapping[str, Spread]
    by_seed: Mapping[int, float]
    views: int
    sem_db: float | None
    difference: Difference | None = None
    to_preset: Difference | None = None

    @property
    def label(self) -> str:
        """The arm's, for people."""
        return ARMS[self.arm].label

    def mean_over(self, seeds: Iterable[int]) -> float:
        """The mean PSNR of some of its seeds, dB."""
        return float(np.mean([self.by_seed[seed] for seed in sorted(seeds)]))


def rows_of(measured: Sequence[Measured]) -> tuple[Row, ...]:
    """The rows in the order of what was measured, those over all scenes after each preset's scenes.

    Over all scenes a row has the seeds that every scene of the preset and count has. Each row is told against the
    strongest baseline of its own table of arms, and against the same row of the first preset.
    """
    presets = list(dict.fromkeys(one.preset for one in measured))
    rows: list[Row] = []
    for preset in presets:
        own = [one for one in measured if one.preset == preset]
        groups = list(dict.fromkeys((one.scene, one.captures) for one in own))
        for scene, captures in groups:
            rows += _compared([_row(one) for one in _by_arm(own, scene, captures)])
        scenes = list(dict.fromkeys(scene for scene, _ in groups))
        for captures in sorted({count for _, count in groups}) if len(scenes) > 1 else ():
            rows += _compared([_row(one) for one in _by_arm(_over_scenes(own, scenes, captures), ALL_SCENES, captures)])
    first = {(row.scene, row.captures, row.arm): row for row in rows if row.preset == presets[0]}
    return tuple(_against(row, first.get((row.scene, row.captures, row.arm))) for row in rows)


def _by_arm(measured: Sequence[Measured], scene: str, captures: int) -> Iterable[list[Measured]]:
    own = [one for one in measured if (one.scene, one.captures) == (scene, captures)]
    for arm in ARMS:
        if of_arm := [one for one in own if one.arm == arm]:
            yield of_arm


def _row(measured: Sequence[Measured]) -> Row:
    first = measured[0]
    kinds = [kind for kind in KINDS if all(kind in one.scores for one in measured)]
    spreads = {kind: Spread.of([one.scores[kind] for one in measured]) for kind in kinds}
    names = [name for name in first.views if all(name in one.views for one in measured)]
    views = np.array([[one.views[name] for name in names] for one in measured]).mean(axis=0) if names else np.zeros(0)
    sem = float(views.std(ddof=1) / np.sqrt(len(views))) if len(views) > 1 and np.isfinite(views).all() else None
    by_seed = {one.seed: one.scores["psnr"] for one in measured}
    return Row(first.preset, first.scene, first.captures, first.arm, spreads, by_seed, len(views), sem)


def _over_scenes(measured: Sequence[Measured], scenes: Sequence[str], captures: int) -> list[Measured]:
    """The means over scenes of each arm and seed that all scenes have; views are those of each scene alone."""
    found = []
    own = {(one.scene, one.arm, one.seed): one for one in measured if one.captures == captures}
    for arm, seed in dict.fromkeys((arm, seed) for _, arm, seed in own):
        each = [own[scene, arm, seed] for scene in scenes if (scene, arm, seed) in own]
        if len(each) < len(scenes):
            continue
        kinds = [kind for kind in KINDS if all(kind in one.scores for one in each)]
        scores = {kind: float(np.mean([one.scores[kind] for one in each])) for kind in kinds}
        found.append(Measured(each[0].preset, ALL_SCENES, captures, seed, arm, scores, {}))
    return found


def _compared(rows: Sequence[Row]) -> list[Row]:
    """Rows of one table with their paired differences to the strongest baseline, which has none itself."""
    if (others := strongest_of(rows)) is None:
        return list(rows)
    return [
        row if row is others else replace(row, difference=Difference.of(others.label, row.by_seed, others.by_seed))
        for row in rows
    ]


def strongest_of(rows: Sequence[Row]) -> Row | None:
    """The method of others with the highest mean PSNR over the seeds that all of them have; None without any.

    One that shares no seed with those that were scored with more is not taken: nothing tells which is stronger.
    """
    compared: list[Row] = []
    seeds = set[int]()
    for row in sorted((row for row in rows if row.arm in BASELINES), key=lambda row: -len(row.by_seed)):
        if shared := seeds & row.by_seed.keys() if compared else {*row.by_seed}:
            compared.append(row)
            seeds = shared
    best = strongest_baseline({row.arm: row.mean_over(seeds) for row in compared})
    return next((row for row in compared if row.arm == best), None)


def _against(row: Row, first: Row | None) -> Row:
    if first is None or first.preset == row.preset:
        return row
    return replace(row, to_preset=Difference.of(first.preset, row.by_seed, first.by_seed))


def worth_of_views(rows: Sequence[Row]) -> list[str]:
    """A sentence for each table of arms that has both: what refined has beyond the arm without generated views."""
    known = {(row.preset, row.scene, row.captures, row.arm): row for row in rows}
    told = []
    for row in rows:
        without = known.get((row.preset, row.scene, row.captures, WITHOUT_GENERATED))
        if row.arm == REFINED and without is not None:
            worth = Difference.of(without.label, row.by_seed, without.by_seed)
            where = f"{row.scene}, {row.captures} captures, {row.preset}"
            told.append(f"Generated views are worth, in {where}: {_difference(worth)}, dB.")
    return told


@dataclass(frozen=True)
class Table:
    """Words in rows: the first three columns are the row's scene, captures and arm. ``shows`` is what it has of a
    preset, "" of the main table."""

    preset: str
    shows: str
    head: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]


def tables_of(rows: Sequence[Row]) -> Iterator[Table]:
    """A table of pictures' scores for each preset, and one of geometry where some was measured."""
    for preset in dict.fromkeys(row.preset for row in rows):
        own = [row for row in rows if row.preset == preset]
        yield _table(preset, "", _columns(own), own)
        measured = [row for row in own if any(kind in row.spreads for kind in _GEOMETRY)]
        if measured:
            kinds = [kind for kind in _GEOMETRY if any(kind in row.spreads for row in measured)]
            yield _table(preset, "geometry", {_GEOMETRY[kind]: _of_kind(kind, 3) for kind in kinds}, measured)


def markdown(rows: Sequence[Row], notes: Sequence[str]) -> str:
    """The tables, and what is to be known of them."""
    lines = []
    for table in tables_of(rows):
        lines += [f"### {table.preset}, {table.shows}" if table.shows else f"## {table.preset}", "", _line(table.head)]
        lines += [_line(["---", "---", "---", *["---:"] * (len(table.head) - 3)]), *map(_line, table.cells), ""]
    return "\n".join([*lines, *(f"- {markdown_text(note)}" for note in [*about(rows), *notes])]) + "\n"


def latex(rows: Sequence[Row], notes: Sequence[str]) -> str:
    """A tabular for each table; what is to be known stands above them as comments."""
    lines = [f"% {latex_text(note)}" for note in [*about(rows), *notes]]
    for table in tables_of(rows):
        lines += [
            f"% {latex_text(', '.join(filter(None, (table.preset, table.shows))))}",
            rf"\begin{{tabular}}{{@{{}}lrl{'r' * (len(table.head) - 3)}@{{}}}}",
            r"  \toprule",
        ]
        lines += [f"  {_row_of(table.head)}", r"  \midrule", *(f"  {_row_of(cells)}" for cells in table.cells)]
        lines += [r"  \bottomrule", r"\end{tabular}"]
    return "\n".join(lines) + "\n"


_ABOUT = (
    "Mean ± sample standard deviation over seeds.",
    "SEM: standard error of PSNR over a scene's views, each averaged over seeds first.",
    "Differences are paired by seed, to the strongest of the methods of others in the same scene and count.",
    "Strongest is the highest mean PSNR over the seeds that all of these have.",
    f"Brackets are Student's {CONFIDENCE:.0%} interval, from two pairs on. Nothing is interpolated.",
)
_ABOUT_REGIONS = (
    "Seen, unseen: PSNR of the pixels that some capture saw, and of those that none saw, means over the views with "
    "such pixels."
)
_ABOUT_GEOMETRY = (
    "Depth: median relative error of the asset's or the proxy's depth against the true room, and share of pixels "
    f"within {RIGHT_DEPTH:.0%}; F: F-score at {100 * SURFACE_TOLERANCE_M:.0f} cm."
)
_CORRECTED = "psnr_corrected"
_ABOUT_CORRECTED = "cc: PSNR after colour correction to each view; what differs is exposure and white balance."
_REGIONS: Mapping[str, str] = {"psnr_seen": "seen, dB", "psnr_unseen": "unseen, dB"}
_GEOMETRY: Mapping[str, str] = {
    "depth_error": "depth error",
    "depth_right": f"depth within {RIGHT_DEPTH:.0%}",
    "proxy_depth_error": "proxy depth error",
    "proxy_depth_right": f"proxy depth within {RIGHT_DEPTH:.0%}",
    "proxy_fscore": "proxy F",
    "collision_fscore": "collision F",
}
"""Columns by their kinds."""

Column = Callable[[Row], str]
"""What a column says of a row."""


def about(rows: Sequence[Row]) -> list[str]:
    """What is to be known of the tables of any experiment."""
    told = list(_ABOUT)
    if any(_CORRECTED in row.spreads for row in rows):
        told.append(_ABOUT_CORRECTED)
    if any(kind in row.spreads for row in rows for kind in _REGIONS):
        told.append(_ABOUT_REGIONS)
    if any(kind in row.spreads for row in rows for kind in _GEOMETRY):
        told.append(_ABOUT_GEOMETRY)
    return told


def _columns(rows: Sequence[Row]) -> dict[str, Column]:
    """Of the main table, by their heads; regions where some were told, and another preset where there is one."""
    columns = {"PSNR, dB": _of_kind("psnr", 2), "SSIM": _of_kind("ssim", 3), "LPIPS": _of_kind("lpips_alex", 3)}
    if any(_CORRECTED in row.spreads for row in rows):
        columns["cc PSNR, dB"] = _of_kind(_CORRECTED, 2)
    if any(kind in row.spreads for row in rows for kind in _REGIONS):
        columns |= {head: _of_kind(kind, 2) for kind, head in _REGIONS.items()}
    columns["SEM over views, dB"] = lambda row: "-" if row.sem_db is None else f"{row.sem_db:.2f} ({row.views})"
    columns["seeds"] = lambda row: str(len(row.by_seed))
    columns["difference, dB"] = lambda row: _difference(row.difference)
    first = next((row.to_preset.to for row in rows if row.to_preset), None)
    if first is not None:
        columns[f"difference to {first}, dB"] = lambda row: _difference(row.to_preset, named=False)
    return columns


def _table(preset: str, shows: str, columns: Mapping[str, Column], rows: Sequence[Row]) -> Table:
    cells = [(row.scene, str(row.captures), row.label, *(column(row) for column in columns.values())) for row in rows]
    return Table(preset, shows, ("scene", "captures", "arm", *columns), tuple(cells))


def _of_kind(kind: str, digits: int) -> Column:
    return lambda row: spread_told(row.spreads.get(kind), digits)


def spread_told(spread: Spread | None, digits: int) -> str:
    """A mean and its deviation in words."""
    if spread is None:
        return "-"
    mean = f"{spread.mean:.{digits}f}" if math.isfinite(spread.mean) else "equal images"
    return mean if spread.std is None else f"{mean} ± {spread.std:.{digits}f}"


def _difference(difference: Difference | None, named: bool = True) -> str:
    if difference is None:
        return "-"
    told = f"{difference.mean:+.2f}"
    if difference.interval is not None:
        low, high = difference.interval
        told += f" [{low:+.2f}, {high:+.2f}]"
    return f"{told} to {difference.to}" if named else told


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(map(markdown_text, cells))} |"


def _row_of(cells: Sequence[str]) -> str:
    return " & ".join(latex_text(cell).replace("±", r"$\pm$") for cell in cells) + r" \\"
