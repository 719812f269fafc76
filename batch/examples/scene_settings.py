"""Open or make a scene, keep its changed settings under a name, take kept ones, and refine.

blender --background --python batch/examples/scene_settings.py -- SCENE --set rounds=1 --keep quick
python batch/examples/scene_settings.py -- SCENE --photographs FOLDER --use quick --refine  (pip bpy)

--photographs makes SCENE, with the poses that lie in FOLDER if there are any; poses above it are named in a warning.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.bridge.scene.settings_properties import overrides, property_name, show_settings
from r2sego_blender.commands.scripts import assignment, run_script
from r2sego_blender.config.presets import PRESETS, entries, preset, with_overrides
from r2sego_blender.core.errors import SceneError


def main(arguments: list[str]) -> int:
    """Open or make, set, and refine; returns 0."""
    parser = argparse.ArgumentParser(prog="scene_settings.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--photographs", type=Path, help="make SCENE from this folder first")
    parser.add_argument("--preset", choices=tuple(PRESETS), help="named settings")
    parser.add_argument("--set", type=assignment, action="append", default=[], metavar="KEY=VALUE", dest="changes")
    parser.add_argument("--reset", action="store_true", help="forget every changed setting first")
    parser.add_argument("--keep", metavar="NAME", help="keep the settings under this name")
    parser.add_argument("--use", metavar="NAME", help="take the settings kept under this name")
    parser.add_argument("--remove", metavar="NAME", help="remove the settings kept under this name")
    parser.add_argument("--refine", action="store_true")
    options = parser.parse_args(arguments)
    with enabled_addon():
        show(options)
    return 0


def show(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    r2sego, state = bpy.ops.r2sego, bpy.context.scene.r2sego
    if options.photographs is not None:
        r2sego.new_scene_from_files(directory=str(options.photographs.absolute()), scene=str(options.scene.absolute()))
    else:
        r2sego.open_scene(directory=str(options.scene.absolute()))
    if options.reset:
        r2sego.reset_settings()
    if options.use:
        try:
            r2sego.load_settings(name=options.use)
        except TypeError as error:  # a name that is none of the menu's
            raise SceneError(f"no settings are kept as '{options.use}'", cure="Use --keep first.") from error
    if options.preset:
        state.preset = options.preset
    change(state, dict(options.changes))
    if options.keep:
        r2sego.keep_settings(name=options.keep)
    if options.remove:
        r2sego.remove_settings(name=options.remove)
    if options.refine:
        r2sego.refine()
        r2sego.refresh_scene()
    for fact in state.facts:
        if fact.section in ("scene", "captures", "robot"):
            print(f"{fact.section}, {fact.label}: {fact.value}")
    print(f"preset: {state.preset}")
    for key, value in overrides(state.settings, state.preset).items():
        print(f"{key} = {value}")


def change(state, changes: dict[str, str]) -> None:
    """Set what a person would type into the panel, as `r2sego refine --set` reads it."""
    shown = state.settings
    known = {entry.key: property_name(entry.key) for entry in entries()}
    already = {key: getattr(shown, name) for key, name in known.items() if shown.is_property_set(name)}
    together = {**already, **changes}
    show_settings(shown, together, with_overrides(together, preset(state.preset)))


if __name__ == "__main__":
    run_script(main)
