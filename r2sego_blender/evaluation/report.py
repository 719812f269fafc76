"""The report: one HTML page without network, and its pictures in ``figures/`` beside it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from ..bundle.layout import REPORT_PAGE
from ..core.atomic_files import UNFINISHED, rename, write_whole
from ..core.errors import CaptureError
from ..geometry.proxy.proxy import PROVENANCE_COLOURS
from .charts import candidate_chart, round_chart
from .figures import save_figure, save_mask
from .frozen_pictures import FIGURES, write_frozen_pictures
from .report_data import Picture, Rendering, ReportData

_TEMPLATES = Path(__file__).with_name("templates")


def write_report(folder: Path, report: ReportData) -> Path:
    """Write ``folder/index.html`` and ``folder/figures/*.jpg``; the page's path.

    The page names its pictures by relative paths, so the folder can be moved or zipped.
    Figures of an earlier report that this one does not show are removed.
    """
    figures = folder / FIGURES
    folder.mkdir(exist_ok=True)
    figures.mkdir(exist_ok=True)
    writer = _FigureWriter(figures)
    environment = page_environment(writer.add, writer.add_mask)
    environment.globals.update(chart=candidate_chart, round_chart=round_chart)
    labels = {arm.key: arm.label for arm in report.arms}
    html = environment.get_template("report.html.j2").render(
        report=report,
        labels=labels,
        headline=_headline(report),
        provenance_colours={kind.name.lower(): colour for kind, colour in PROVENANCE_COLOURS.items()},
        total_s=sum(seconds for _, seconds in report.timings),
    )
    page = folder / REPORT_PAGE
    write_whole(page, html)
    write_frozen_pictures(folder, report.frozen, writer.name)
    writer.remove_others()
    return page


def page_environment(
    figure: Callable[..., str], mask: Callable[..., str], more_templates: Path | None = None
) -> jinja2.Environment:
    """The environment of pages made of the shared parts: ``figure`` and ``mask`` are given a picture and words that
    name it, and give what ``src`` is to be."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([*filter(None, [more_templates]), _TEMPLATES]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(decimals=_decimals, seconds=_duration, percent=_percent, of_regions=_of_regions)
    environment.globals.update(figure=figure, mask=mask, css_colour=_css_colour)
    return environment


class _FigureWriter:
    """Writes the pictures the template asks for and gives their relative paths."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._written: dict[str, Picture] = {}

    def add(self, picture: Picture, *words: object) -> str:
        """The path of a picture's file, named by ``words``, or "" without a picture.

        A picture whose file is missing or unreadable is left out of the page: a report must
        not fail for one lost picture. A picture asked for again under the same words is
        written once.
        """
        if picture is None:
            return ""
        return self._saved(picture, save_figure, ".jpg", words)

    def add_mask(self, mask: Picture, *words: object) -> str:
        """The same of a mask (H, W) bool."""
        return "" if mask is None else self._saved(mask, save_mask, ".png", words)

    def name(self, picture: Picture) -> str:
        """The name of a picture's file, "" of one that has none."""
        return next((name for name, one in self._written.items() if one is picture), "")

    def _saved(
        self, picture: Picture, save: Callable[[Path, Any], None], suffix: str, words: tuple[object, ...]
    ) -> str:
        stem = re.sub(r"[^a-z0-9]+", "-", " ".join(map(str, words)).lower()).strip("-") or "figure"
        name, copies = f"{stem}{suffix}", 1
        while name in self._written:
            if self._written[name] is picture:
                return f"{FIGURES}/{name}"
            copies += 1
            name = f"{stem}-{copies}{suffix}"
        try:
            made = self._folder / f"{UNFINISHED}{name}"
            save(made, picture)
            rename(made, self._folder / name)
        except (OSError, CaptureError):
            return ""
        self._written[name] = picture
        return f"{FIGURES}/{name}"

    def remove_others(self) -> None:
        """Remove figures of earlier reports."""
        for path in self._folder.iterdir():
            if path.suffix in (".jpg", ".png") and path.name not in self._written:
                path.unlink()


def _headline(report: ReportData) -> dict | None:
    """The last arm against the baseline, for the top of the page; None without scores."""
    by_key = {arm.key: arm for arm in report.arms}
    best, baseline = (report.arms[-1] if report.arms else None), by_key.get(report.baseline)
    if best is None or best.psnr is None:
        return None
    if baseline is None or baseline.psnr is None or baseline is best:
        return {"arm": best, "baseline": None, "gain_db": None}
    return {"arm": best, "baseline": baseline, "gain_db": best.psnr - baseline.psnr}


def _decimals(value: float | None, places: int = 2) -> str:
    if value is None:
        return "n/a"
    return f"{value:.{places}f}" if math.isfinite(value) else "∞"


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %"


def _duration(value_s: float) -> str:
    """Seconds as a person reads them: ``8.4 s``, ``3 min 20 s``, ``2 h 05 min``."""
    if value_s < 60:
        return f"{value_s:.1f} s"
    minutes, seconds = divmod(round(value_s), 60)
    if minutes < 60:
        return f"{minutes} min {seconds:02d} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min"


def _of_regions(rendering: Rendering) -> str:
    """What a picture's caption says of the pixels that captures saw and of the others; "" where that is not known."""
    regions = (("seen", rendering.psnr_seen), ("unseen", rendering.psnr_unseen))
    told = [f"{name} {_decimals(psnr)}" for name, psnr in regions if psnr is not None]
    return f"; {', '.join(told)}" if told else ""


def _css_colour(rgb: tuple[float, float, float]) -> str:
    red, green, blue = np.round(np.array(rgb) * 255).astype(int)
    return f"rgb({red} {green} {blue})"
