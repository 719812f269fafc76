"""Captures in a scene bundle: images at working size, cameras.json and a COLMAP model."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from ..bundle import layout
from ..bundle.artifacts import Artifact
from ..core.errors import CaptureError
from ..core.images import save_image
from ..core.json_files import write_json
from .capture import Capture
from .exposure import MOST_GAIN, Gain
from .lenses.lens import Lens
from .poses.colmap_model import save_colmap_model
from .registered_views import CURE, damaged_entry, read_registered_views
from .sensors.sensor_maps import SensorMap
from .sparse_points import SparsePoints


def save_captures(
    folder: Path,
    captures: Sequence[Capture],
    sparse: SparsePoints | None = None,
    measured: Mapping[str, SensorMap] = MappingProxyType({}),
) -> tuple[Capture, ...]:
    """Write world-frame captures, their sparse points and what a sensor ``measured``, under ``folder``.

    ``images/*.png`` (undistorted, working size, as exposed), ``cameras.json`` (docs/formats.md),
    ``sparse.npz`` and ``sparse/`` (COLMAP text model in the world frame), ``depth/*.npz`` of those
    captures whose names have a map. Returns the
    captures as ``load_captures`` would. The same captures give the same bytes.
    """
    (folder / "images").mkdir(parents=True, exist_ok=True)
    stored, listed = [], []
    taken: set[str] = set()
    for capture in captures:
        path = folder / "images" / _file_name(capture.name, taken)
        save_image(path, capture.as_taken())
        kept = replace(capture, image_path=path, straight=capture.lens is not None)
        stored.append(kept)
        entry = {"file": f"images/{path.name}", "name": kept.name} | kept.camera.to_json()
        if kept.lens is not None:
            entry["photograph_lens"] = kept.lens.to_json()
        if kept.given_lens is not None:
            entry["given_lens"] = kept.given_lens.to_json()
        if kept.quarter_turns:
            entry["photograph_turns"] = kept.quarter_turns
        if kept.gain is not None:
            entry["exposure_gain"] = list(kept.gain)
        if kept.weight != 1.0:
            entry["weight"] = kept.weight
        listed.append(entry)
    data = {"about": "Captures in the world frame: metres, z up, floor at z = 0.", "metric": True}
    write_json(folder / "cameras.json", data | {"captures": listed})
    save_colmap_model(folder / "sparse", stored, sparse)
    if sparse is not None:
        sparse.save(folder / "sparse.npz")
    if measured:
        place = folder / Path(layout.SENSOR_DEPTH).name
        place.mkdir(exist_ok=True)
        for capture, file in zip(stored, layout.capture_files([c.name for c in stored]), strict=True):
            if capture.name in measured:
                measured[capture.name].save(place / file)
    return tuple(stored)


def load_captures(folder: Path) -> tuple[Capture, ...]:
    """The captures that ``save_captures`` wrote.

    Raises CaptureError when the folder is damaged, an image is missing or there is no capture at all.
    """
    captures = []
    for index, view in enumerate(read_registered_views(folder)):
        entry = view.entry
        try:
            lens, given = (
                Lens.from_json(entry[key]) if key in entry else None for key in ("photograph_lens", "given_lens")
            )
            turns = int(entry.get("photograph_turns", 0))
            if turns not in range(4):
                raise ValueError(f"it is turned {turns} times")
            gain = _gain(entry["exposure_gain"]) if "exposure_gain" in entry else None
            weight = float(entry.get("weight", 1.0))
            if not 0.0 < weight <= 1.0:
                raise ValueError(f"its weight is {weight}")
            is_there = view.image_path.is_file()
        except (LookupError, TypeError, ValueError, AttributeError, OSError) as error:
            raise damaged_entry(folder / "cameras.json", index, error) from error
        if not is_there:
            raise CaptureError("the capture's image is missing", where=view.image_path, cure=CURE)
        captures.append(
            Capture(
                view.name,
                view.image_path,
                view.camera,
                lens,
                lens is not None,
                quarter_turns=turns,
                given_lens=given,
                gain=gain,
                weight=weight,
            )
        )
    return tuple(captures)


def _gain(values: Sequence[float]) -> Gain:
    red, green, blue = map(float, values)
    if not all(1.0 / MOST_GAIN <= one <= MOST_GAIN for one in (red, green, blue)):
        raise ValueError(f"its exposure gain is {values}")
    return red, green, blue


def _file_name(name: str, taken: set[str]) -> str:
    """A plain ``.png`` name that no other capture has, on any file system."""
    stem = re.sub(r"[^A-Za-z0-9._-]", "_", Path(name).stem).strip(".") or "capture"
    choice, count = stem, 1
    while choice.lower() in taken:
        count += 1
        choice = f"{stem}_{count}"
    taken.add(choice.lower())
    return f"{choice}.png"


CAPTURES = Artifact(layout.CAPTURES, load_captures)
"""The capture set C: photographs with their cameras in the world."""
