"""What the room Asset knows of the open bundle: its assets with their scores, and the deletions it keeps."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import Facts
from ...r2sego_blender.bundle.asset_stages import FINAL, INITIAL, stages
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.file_stamps import when_written
from ...r2sego_blender.results.panels.report_scores import ARM_LABELS, not_scored
from ...r2sego_blender.splats.asset_edits import ASSET_EDITS
from ...r2sego_blender.splats.formats.ply_vertices import vertex_count
from ..state import Line

_FEW_SPLATS = 10000


@dataclass(frozen=True)
class ListedStage:
    """An asset the bundle holds, named initial, by a round's number, or final, and when it was ``written``;
    ``target`` is its name in the bundle."""

    name: str
    label: str
    target: str
    gaussians: int
    written: str


@dataclass(frozen=True)
class ListedEdit:
    """A deletion that the bundle keeps, its regions in words and as JSON has them."""

    name: str
    regions: str
    described: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class AssetFacts:
    """The bundle's assets, the oldest first, and its deletions."""

    stages: Facts = Facts()
    edits: Facts = Facts()
    lines: tuple[Line, ...] = ()


def read(_scene: bpy.types.Scene, bundle: Bundle) -> AssetFacts:
    """The assets, with their scores as last evaluated. Raises R2SEgoError naming a damaged asset or deletion."""
    listed = Facts(
        ListedStage(one.name, one.label, one.target, vertex_count(one.file), when_written(one.file))
        for one in stages(bundle.scene)
    )
    edits = Facts(_edit(edit.name, edit.regions) for edit in bundle.read(ASSET_EDITS))
    lines = (Line("asset", label, value) for label, value in _lines(bundle, listed))
    return AssetFacts(listed, edits, tuple(lines))


def _edit(name: str, regions: Any) -> ListedEdit:
    described = tuple(region.to_json() for region in regions)
    return ListedEdit(name, ", ".join(region["kind"] for region in described), described)


def _lines(bundle: Bundle, listed: Facts) -> Iterator[tuple[str, str]]:
    try:
        metrics = bundle.metrics()
        scores, changed = _scores(metrics), not_scored(bundle, metrics)
    except (R2SEgoError, AttributeError, KeyError, TypeError, ValueError):  # Report tells it
        scores, changed = {}, frozenset()
    for stage in listed:
        told = _count(stage.gaussians)
        score = scores.pop(stage.name, None)
        if score is not None and stage.target not in changed:
            told += f", {score:.2f} dB"
        yield stage.label, told
    for name, score in scores.items():
        if score is not None:
            yield name, f"{score:.2f} dB"


def _scores(metrics: Mapping[str, Any]) -> dict[str, float | None]:
    """The PSNR of each stage and of other assets on frozen views, by name, as last evaluated."""
    names = ARM_LABELS | {"initial": INITIAL, "refined": FINAL}
    told = {names.get(name, name): arm["psnr"] for name, arm in (metrics.get("arms") or {}).items()}
    told |= {str(one["round"]): one["psnr"] for one in metrics.get("rounds") or ()}
    return {name: None if psnr is None else float(psnr) for name, psnr in told.items()}


def _count(gaussians: int) -> str:
    """So short that a score has room beside it."""
    return f"{gaussians} splats" if gaussians < _FEW_SPLATS else f"{gaussians / 1000:.0f}k splats"
