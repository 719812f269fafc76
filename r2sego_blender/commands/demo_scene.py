"""The demo room that comes with the project: six photographs with poses, made into a scene and refined."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..bundle.scene import Scene
from ..captures.store import CAPTURES
from ..config.presets import with_overrides
from ..core.errors import MachineError, SceneError
from ..core.images import image_files
from ..core.progress import Progress
from ..evaluation.scene_report import renew_scene_report
from ..pipeline import refine
from ..refine.creation import create_scene

ROOM = Path(__file__).resolve().parents[2] / "demo" / "room"


def make_demo_scene(
    path: Path, preset: str | None, overrides: Mapping[str, Any], progress: Progress, room: Path = ROOM
) -> Scene:
    """Make the bundle ``path`` of the demo room, unless it is there, and refine it to its end.

    ``preset`` None is "preview", or what the bundle that is there declares; its settings stay beside
    ``overrides``, as in a refinement.

    Raises MachineError when the room's photographs are not here, and SceneError when ``path`` is a
    bundle of something else.
    """
    cameras = room / "cameras.json"
    if not cameras.is_file():
        raise MachineError(
            "the demo room is not here", where=room,
            cure="It comes with the Blender extension and with a checkout, not with the Python package.",
        )  # fmt: skip
    if path.exists():
        scene = Scene.open(path)
        _require_demo(scene, room)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        settings = with_overrides(dict(overrides)).captures
        scene = create_scene(path, room / "captures", cameras, settings=settings, progress=progress)
        preset = preset or "preview"
    with scene.locked():
        asked = scene.declaration.with_settings(preset, overrides)
        scene = scene.declare(preset=asked.preset, overrides=asked.overrides)
        before = scene.journal()
        refine(scene, progress)
        renew_scene_report(scene, before)
    return scene


def _require_demo(scene: Scene, room: Path) -> None:
    stored = scene.read(CAPTURES)
    if {capture.name for capture in stored} != {file.name for file in image_files(room / "captures")}:
        raise SceneError(
            "this is a scene of other photographs", where=scene.path,
            cure="Choose another place for the demo scene.",
        )  # fmt: skip
