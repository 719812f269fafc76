"""Paint objects' masks on the captures from pictures, remove objects, and declare what is left.

blender --background --python batch/examples/proxy_masks.py -- SCENE --paint chair:photo_01.png=chair_01.png
python batch/examples/proxy_masks.py -- SCENE --remove lamp  (pip bpy)

A picture has its capture's size and is white where the capture shows the object. A capture is named
with its suffix, as in the bundle.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import assignment, run_script
from r2sego_blender.core.errors import GeometryError


def main(arguments: list[str]) -> int:
    """Paint, remove and declare; returns 0."""
    parser = argparse.ArgumentParser(prog="proxy_masks.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--paint", type=assignment, action="append", default=[], metavar="OBJECT:CAPTURE=PICTURE")
    parser.add_argument("--remove", action="append", default=[], metavar="OBJECT")
    options = parser.parse_args(arguments)
    with enabled_addon():
        r2sego, group = bpy.ops.r2sego, bpy.context.scene.r2sego_proxy
        r2sego.open_scene(directory=str(options.scene.absolute()))
        r2sego.load_masks()
        for place, picture in options.paint:
            name, _, capture = place.partition(":")
            paint(name, capture, Path(picture).absolute())
        for name in options.remove:
            r2sego.remove_object(name=name)
        if options.paint or options.remove:
            r2sego.declare_masks()
        for one in group.objects:
            print(f"{one.name}: {one.masks} masks, {one.state}")
    return 0


def paint(name: str, capture: str, picture: Path) -> None:
    """Fill an object's mask of a capture as a person would in the Image Editor."""
    r2sego = bpy.ops.r2sego
    if name not in bpy.context.scene.r2sego_proxy.objects:
        r2sego.new_object(name=name)
    r2sego.paint_mask(object_name=name, capture=capture)
    mask, source = bpy.data.images[f"{name} in {capture}"], bpy.data.images.load(str(picture))
    if source.size[:] != mask.size[:]:
        sizes = f"{source.size[0]}x{source.size[1]}, not {mask.size[0]}x{mask.size[1]}"
        raise GeometryError(f"the picture is {sizes}", where=picture, cure="Give one of its capture's size.")
    source.colorspace_settings.name = mask.colorspace_settings.name
    mask.pixels = source.pixels[:]
    mask.update()
    print(f"painted {mask.name}")


if __name__ == "__main__":
    run_script(main)
