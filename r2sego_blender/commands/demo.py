"""``r2sego demo``: the demo room's six photographs with poses, made into a scene and refined."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..bundle.scene import Scene
from ..config.presets import PRESETS, with_overrides
from ..core.errors import MachineError, SceneError
from ..core.images import image_files
from ..core.progress import Progress
from .options import ANY_PATH, Output, output_options, overrides_of, settings_option

ROOM = Path(__file__).resolve().parents[2] / "demo" / "room"


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--preset", type=click.Choice(list(PRESETS)), help="Named settings; preview, or what SCENE has declared.")
@settings_option
@output_options("--json-progress")
def demo(scene: Path, preset: str | None, overrides: tuple[str, ...], output: Output) -> None:
    """Make SCENE of the demo room and refine it; started again, it goes on where it stopped.

    It takes some minutes, with --preset paper 15 and more.
    """
    made = make_demo_scene(scene, preset, overrides_of(overrides), output.progress)
    output.tell(scene=str(made.path), asset=str(made.asset_file))


COMMANDS = (demo,)


def make_demo_scene(
    path: Path, preset: str | None, overrides: Mapping[str, Any], progress: Progress, room: Path = ROOM
) -> Scene:
    """Make the bundle ``path`` of the demo room, unless it is there, and refine it to its end.

    ``preset`` None is "preview", or what the bundle that is there declares; its settings stay beside
    ``overrides``, as in a refinement.

    Raises MachineError when the room's photographs are not here, and SceneError when ``path`` is a
    bundle of something else.
    """
    from ..evaluation.refinement import refine_with_report
    from ..refine.creation import create_scene

    cameras = room / "cameras.json"
    if not cameras.is_file():
        raise MachineError(
            "the demo room is not here",
            where=room,
            cure="It comes with the Blender extension and with a checkout, not with the Python package.",
        )
    if path.exists():
        scene = Scene.open(path)
        _require_demo(scene, room)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        settings = with_overrides(dict(overrides)).captures
        scene = create_scene(path, room / "captures", cameras, settings=settings, progress=progress)
        preset = preset or "preview"
    return refine_with_report(scene, preset, overrides, progress)[0]


def _require_demo(scene: Scene, room: Path) -> None:
    from ..captures.store import CAPTURES

    stored = scene.read(CAPTURES)
    if {capture.name for capture in stored} != {file.name for file in image_files(room / "captures")}:
        raise SceneError(
            "this is a scene of other photographs", where=scene.path, cure="Choose another place for the demo scene."
        )
