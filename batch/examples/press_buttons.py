"""Press any of the add-on's buttons in a scene, one after the other, by their operators' names.

blender --background --python batch/examples/press_buttons.py -- SCENE
    show_proxy look_inside=False  clear_region  use_mesh_as_prior object_name=chair mesh=Chair
python batch/examples/press_buttons.py -- SCENE remove_object name=chair --save room.blend  (pip bpy)

A name is an operator of ``bpy.ops.r2sego``; what follows it are its properties, as Python writes
their values (text needs no quotes). ``--select NAME`` chooses an object before each button. ``--list``
prints every operator with its properties. Options may stand anywhere.
"""

import argparse
import ast
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import SceneError

_INNER = {"rna_type", "job_folder", "filter_glob", "filter_folder"}
"""Properties that are for Blender, its file browser and jobs."""


def main(arguments: list[str]) -> int:
    """Open the scene, press, and save if asked; returns 0."""
    parser = argparse.ArgumentParser(prog="press_buttons.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path, nargs="?")
    parser.add_argument("buttons", nargs="*", help="operator names, each followed by property=value")
    parser.add_argument("--select", help="the object to make active before each button, if it is there")
    parser.add_argument("--save", type=Path, help="a .blend to save afterwards")
    parser.add_argument("--list", action="store_true", help="print every operator and its properties")
    options = parser.parse_intermixed_args(arguments)
    with enabled_addon():
        if options.list:
            print("\n".join(described(name) for name in dir(bpy.ops.r2sego)))
            return 0
        if options.scene is None:
            parser.error("name a scene, or --list")
        bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
        for name, properties in calls(options.buttons):
            if options.select and options.select in bpy.data.objects:
                bpy.context.view_layer.objects.active = bpy.data.objects[options.select]
            require_in_range(name, **properties)
            done = getattr(bpy.ops.r2sego, name)(**properties)
            print(f"{name}: {', '.join(done).lower()}")
        if options.save is not None:
            bpy.ops.wm.save_as_mainfile(filepath=str(options.save.absolute()))
    return 0


def calls(words: list[str]) -> list[tuple[str, dict]]:
    """The operators and their properties. Raises SceneError for a name that is no operator's."""
    found: list[tuple[str, dict]] = []
    for word in words:
        name, equals, value = word.partition("=")
        if equals and found:
            found[-1][1][name] = literal(value)
        elif name in dir(bpy.ops.r2sego):
            found.append((name, {}))
        else:
            raise SceneError(f"there is no operator '{name}'", cure="See --list.")
    return found


def literal(text: str) -> object:
    """A property's value: a number, a list and the like as Python writes it, else the text itself."""
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def described(name: str) -> str:
    """An operator's line: its name, its properties, what it does."""
    kind = getattr(bpy.ops.r2sego, name).get_rna_type()
    names = [prop.identifier for prop in kind.properties if prop.identifier not in _INNER]
    return f"{name}({', '.join(names)}): {kind.description}"


if __name__ == "__main__":
    run_script(main)
