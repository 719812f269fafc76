"""Which pictures there are of a generated view, and the frozen view nearest to it. No bpy."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

import numpy as np

from ...captures.poses import json_fields as fields
from ...core.errors import CaptureError, GenerationError
from ...generation.view_records import ViewRecord, read_views
from .bundle import Bundle

KINDS = {
    "asset": "the asset as the view sees it, where it was rendered",
    "depth": "the proxy's depth, light near, dark far",
    "normal": "the proxy's normals in the camera's axes",
    "provenance": "what geometry is by: grey observed, blue measured, teal prior, amber completed, mauve estimated",
    "points": "the captures' colours on the proxy",
    "reference": "the photograph the clip starts at",
    "clip": "a frame of the generated clip",
    "frame": "the generated frame that is kept",
    "confidence": "how sure the generator is of each pixel",
    "truth": "the frozen view nearest to it, for looking at alone",
}
"""The parts of a comparison, in their order, and what each shows."""

_CONDITIONS = ("depth", "normal", "provenance", "points")
_FARTHEST_M, _LARGEST_TURN_DEG = 0.5, 30.0


@dataclass(frozen=True)
class Part:
    """One picture: its words, its file, and the kind of ``KINDS`` it is."""

    label: str
    file: Path
    kind: str


def views_of_round(bundle: Bundle, round_index: int) -> list[ViewRecord]:
    """A round's generated views, by rank; none before line 11 of Algorithm 1."""
    budget = bundle.scene.declaration.settings.selection.target_views
    return read_views(bundle.scene.round_folder(round_index) / "views", budget)


def clip_files(view: Path) -> list[Path]:
    """The frames of a view's clip in their order, [] when none was generated."""
    return sorted((view / "clip").glob("[0-9][0-9][0-9].png"))


def view_parts(
    bundle: Bundle,
    record: ViewRecord,
    kinds: Collection[str],
    *,
    clip_frame: int = -1,
    asset: Mapping[str, Path] | None = None,
    truth: tuple[str, Path] | None = None,
) -> list[Part]:
    """What of ``kinds`` there is of a view, in the order of ``KINDS``; what is missing is left out.

    Conditions are those of the kept frame. ``clip_frame`` is a frame of the clip, -1 its middle
    one. ``asset`` are renderings of the asset by their label; ``truth`` is a label and a file.
    """
    parts = [Part(label, file, "asset") for label, file in (asset or {}).items()]
    parts += [Part(f"proxy: {kind}", file, kind) for kind, file in _condition_files(record).items()]
    photograph = {view.name: view.image_path for view in bundle.captures()}.get(record.reference)
    if photograph is not None:
        parts.append(Part(f"reference {record.reference}", photograph, "reference"))
    clip = clip_files(record.folder)
    if clip:
        shown = len(clip) // 2 if clip_frame < 0 else min(clip_frame, len(clip) - 1)
        parts.append(Part(f"clip, frame {shown} of {len(clip) - 1}", clip[shown], "clip"))
    parts.append(Part("kept frame", record.folder / "frame.png", "frame"))
    parts.append(Part("confidence", record.folder / "confidence.png", "confidence"))
    if truth is not None:
        parts.append(Part(*truth, "truth"))
    order = list(KINDS)
    wanted = [part for part in parts if part.kind in kinds and part.file.is_file()]
    return sorted(wanted, key=lambda part: order.index(part.kind))


def nearest_truth(file: Path, world_from_capture: np.ndarray, pose: np.ndarray) -> tuple[str, Path] | None:
    """The frozen view of a ``cameras.json`` nearest to ``pose`` (4, 4), with its distance in words.

    ``world_from_capture`` (4, 4) takes the file's frame to the world. None when none is within
    0.5 m and 30 degrees. Raises CaptureError when the file has no frozen views or is damaged.
    """
    found = []
    for index, entry in enumerate(fields.entries(fields.read_json(file), "frozen", file)):
        field = f"frozen[{index}]"
        name = fields.text("file", file, field, entry)
        stood = world_from_capture @ fields.matrix("world_from_camera", file, field, entry)
        away_m = float(np.linalg.norm(stood[:3, 3] - pose[:3, 3]))
        forward = stood[:3, 2] / np.linalg.norm(stood[:3, 2])
        turn_deg = float(np.degrees(np.arccos(np.clip(forward @ pose[:3, 2], -1.0, 1.0))))
        if away_m <= _FARTHEST_M and turn_deg <= _LARGEST_TURN_DEG:
            found.append((away_m / _FARTHEST_M + turn_deg / _LARGEST_TURN_DEG, name, away_m, turn_deg, field))
    if not found:
        return None
    _, name, away_m, turn_deg, field = min(found)
    # As the importer has it: a path that leads elsewhere is looked up by its file name.
    elsewhere = Path(name).is_absolute() or ".." in PureWindowsPath(name).parts
    picture = file.parent / (PureWindowsPath(name).name if elsewhere else name)
    with contextlib.suppress(OSError):  # of a name that is too long for any
        if picture.is_file():
            return f"truth {picture.stem}, {away_m:.2f} m, {turn_deg:.0f} deg off", picture
    raise CaptureError("the frozen photograph is missing", where=f"{file}, {field}", cure="Check 'file'.")


def require_view(records: list[ViewRecord], rank: int) -> ViewRecord:
    """The view of this rank. Raises GenerationError when there is none."""
    for record in records:
        if record.rank == rank:
            return record
    raise GenerationError(f"there is no generated view {rank}", cure="Choose one of the list, or another round.")


def _condition_files(record: ViewRecord) -> dict[str, Path]:
    """The PNGs of the kept frame's conditions by kind."""
    folder = record.folder / "conditions"
    last = max(folder.glob("[0-9][0-9][0-9]_depth.png"), default=None)
    if last is None:
        return {}
    number = last.name.partition("_")[0]
    return {kind: folder / f"{number}_{kind}.png" for kind in _CONDITIONS}
