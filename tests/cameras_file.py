"""Writes captures as this project's ``cameras.json``, for tests that read one."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from r2sego_blender.captures.capture import Capture


def save_cameras_json(
    path: Path,
    captures: Iterable[Capture],
    *,
    frozen: Iterable[Capture] = (),
    metric: bool = True,
    about: str = "",
    folder: Path | None = None,
) -> None:
    """Write captures, and held-out views if any, as a ``cameras.json``.

    File names are relative to ``folder`` (default: the file's own folder) where the images
    lie inside it. The images themselves are not written.
    """
    base = (folder or path.parent).resolve()
    data: dict[str, Any] = {"about": about} if about else {}
    data |= {"metric": metric, "captures": [_entry(capture, base) for capture in captures]}
    views = [_entry(view, base) for view in frozen]
    if views:
        data["frozen"] = views
    path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _entry(capture: Capture, base: Path) -> dict[str, Any]:
    image_path = capture.image_path.resolve()
    inside = image_path.is_relative_to(base)
    entry: dict[str, Any] = {"file": image_path.relative_to(base).as_posix() if inside else image_path.name}
    if capture.lens is not None and not capture.straight:
        entry |= capture.lens.to_json()
        entry["world_from_camera"] = capture.camera.world_from_camera.tolist()
    else:
        entry |= capture.camera.to_json()
    return entry
