"""The pictures of an experiment's page: of each scene, count and preset its first cell's frozen views, worst first.

They are made small, and no more are taken than a page may hold.
"""

from __future__ import annotations

import base64
import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from PIL import Image

from ..bundle.scene import Scene
from ..core.errors import EvaluationError, R2SEgoError
from ..core.images import load_image_uint8
from ..evaluation.arms import ARMS
from ..evaluation.cause_figures import split_in
from ..evaluation.frozen_pictures import FROZEN_PICTURES
from ..evaluation.report_data import ErrorSplit, FrozenView, Rendering
from .cells import Cell
from .records import Record, score_of

MOST_BYTES = 24 << 20
"""Of all pictures of a page together."""

_WIDEST_PX, _QUALITY = 640, 75
_KEPT = 2048  # pictures of one process that are not made again for the next page
_MASK_BYTES = 1 << 18


@dataclass(frozen=True)
class ShownCell:
    """What the page shows of one cell.

    ``frozen`` are its views, worst first by the last arm, with files for pictures, of which the last ``left_out`` have
    none; ``problem`` says why there are no pictures at all.
    """

    cell: Cell
    record: Record
    arms: tuple[str, ...]
    frozen: tuple[FrozenView, ...] = ()
    causes: ErrorSplit | None = None
    problem: str = ""
    left_out: int = 0

    @property
    def pictured(self) -> tuple[FrozenView, ...]:
        """The views that are shown."""
        return self.frozen[: len(self.frozen) - self.left_out]


def shown_cells(done: Sequence[tuple[Cell, Record]]) -> tuple[ShownCell, ...]:
    """The first cell that is done of each preset, scene and count, in the order of the plan, before a page's bound."""
    first: dict[tuple[str, str, int], tuple[Cell, Record]] = {}
    for cell, record in done:
        first.setdefault(cell.group, (cell, record))
    return tuple(_shown(cell, record) for cell, record in first.values() if any(arm in record.arms for arm in ARMS))


def within_bound(
    cells: Sequence[ShownCell], most_bytes: int = MOST_BYTES
) -> tuple[tuple[ShownCell, ...], dict[Path, str]]:
    """The cells with as many views as fit, and each picture's data URI by its file.

    Every cell's worst view is taken first, then every cell's next: what does not fit are the best views.
    """
    found: dict[Path, str] = {}
    taken = dict.fromkeys(range(len(cells)), 0)
    left = most_bytes
    for rank in range(max((len(one.frozen) for one in cells), default=0)):
        for index, one in enumerate(cells):
            if rank >= len(one.frozen):
                continue
            made = {file: uri for file in _files(one.frozen[rank]) if (uri := _data_uri(file))}
            size = sum(map(len, made.values()))
            if size > left:
                return _cut(cells, taken), found
            left -= size
            found |= made
            taken[index] += 1
    return _cut(cells, taken), found


def _cut(cells: Sequence[ShownCell], taken: Mapping[int, int]) -> tuple[ShownCell, ...]:
    return tuple(replace(one, left_out=len(one.frozen) - taken[index]) for index, one in enumerate(cells))


def _shown(cell: Cell, record: Record) -> ShownCell:
    arms = tuple(arm for arm in ARMS if arm in record.arms)
    try:
        bundle = Scene.open(cell.bundle)
        metrics = bundle.read(cell.metrics)
        if metrics.get("assets", {}) != record.assets:
            raise EvaluationError("it was changed since", where=cell.bundle, cure="Remove the cell's record.")
        pictures = bundle.read(FROZEN_PICTURES)
    except R2SEgoError as error:
        return ShownCell(cell, record, arms, problem=f"There are no pictures of its bundle: {error.what}.")
    scored = {arm: {view["name"]: view for view in record.arms[arm]["views"]} for arm in arms}
    views = []
    for name in sorted(scored[arms[-1]], key=lambda name: (score_of(scored[arms[-1]][name], "psnr") or 0.0, name)):
        if name not in pictures:
            continue
        files = pictures[name]
        renderings = tuple(
            Rendering(arm, files.arms.get(arm), *(score_of(scored[arm].get(name, {}), kind) for kind in _KINDS))
            for arm in arms
        )
        views.append(FrozenView(name, files.truth, renderings, files.unseen))
    return ShownCell(cell, record, arms, tuple(views), split_in(metrics.get("causes")))


_KINDS = ("psnr", "ssim", "psnr_seen", "psnr_unseen")


def _files(view: FrozenView) -> list[Path]:
    places = (view.truth, *(one.picture for one in view.renderings), view.unseen)
    return [place for place in places if isinstance(place, Path)]


def _data_uri(file: Path) -> str:
    """A picture as the page has it; "" for one that cannot be read."""
    with contextlib.suppress(OSError, R2SEgoError):
        told = file.stat()
        return _made(file, told.st_mtime_ns, told.st_size)
    return ""


@lru_cache(_KEPT)
def _made(file: Path, _changed_ns: int, size: int) -> str:
    if file.suffix == ".png":  # what no capture saw: two colours, small as it is
        data, kind = (file.read_bytes() if size <= _MASK_BYTES else b""), "png"
    else:
        image, kind = Image.fromarray(load_image_uint8(file)), "jpeg"
        image.thumbnail((_WIDEST_PX, _WIDEST_PX))
        buffer = io.BytesIO()
        image.save(buffer, "JPEG", quality=_QUALITY)
        data = buffer.getvalue()
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}" if data else ""
