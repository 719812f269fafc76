"""Colour a round's proxy, mask and place an object, cut and draw, and say what Refine would redo.

blender --background --python batch/examples/proxy_edits.py -- SCENE [--round 0] [--mask CAPTURE:X,Y X,Y X,Y]
python batch/examples/proxy_edits.py -- SCENE [--cut-box X,Y,Z:SIDE] [--keep]  (pip bpy)

What it edits it takes back, unless --keep is given. A capture is named with its suffix, as in the
bundle: --mask "photo_01.png:10,10 90,10 90,60".
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from capture_lasso import lasso
from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import numbers, run_script


def main(arguments: list[str]) -> int:
    """Press the room's buttons one after the other; returns 0."""
    parser = argparse.ArgumentParser(prog="proxy_edits.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--round", type=int, default=0, help="from 0")
    parser.add_argument("--coverage", action="store_true", help="have the engine measure it")
    parser.add_argument(
        "--mask", type=lasso, metavar="CAPTURE:X,Y X,Y X,Y", help="a polygon around an object, in pixels"
    )
    parser.add_argument("--cut-box", type=cube, metavar="X,Y,Z:SIDE", help="cut the faces in this cube, metres")
    parser.add_argument("--keep", action="store_true", help="leave the edits and the new object in the bundle")
    options = parser.parse_args(arguments)
    with enabled_addon():
        r2sego = bpy.ops.r2sego
        r2sego.open_scene(directory=str(options.scene.absolute()))
        bpy.context.scene.r2sego.round_index = options.round
        colour(r2sego, options.coverage)
        priors(r2sego)
        if options.mask:
            mask(r2sego, *options.mask, declare=options.keep)
        edits(r2sego, options.cut_box)
        r2sego.plan_refine()
        print(bpy.context.scene.r2sego_proxy.plan)
        if not options.keep:
            for name in [edit.name for edit in bpy.context.scene.r2sego_proxy.edits]:
                if name.startswith("example_"):
                    r2sego.remove_proxy_edit(name=name)
    return 0


def colour(r2sego, coverage: bool) -> None:
    """Show the proxy and print the legend of each colouring."""
    group = bpy.context.scene.r2sego_proxy
    r2sego.show_proxy()
    if coverage:
        r2sego.measure_coverage()
    for by in group.bl_rna.properties["colour_by"].enum_items:
        group.colour_by = by.identifier
        areas = ", ".join(f"{line.name} {line.area:.1f} m2" for line in group.legend)
        print(f"{by.name}: {areas or group.legend_note}")


def priors(r2sego) -> None:
    """Show the priors, and rate each where it stands."""
    group = bpy.context.scene.r2sego_proxy
    r2sego.show_priors()
    for name, state, placed in [(item.name, item.state, item.shape) for item in group.objects]:
        line = f"{name}: {state}"
        if placed and group.objects[name].has_prior:
            r2sego.place_prior(object_name=name)
            line += f", overlap {group.fit_iou:.2f} ({group.fit_views})"
        print(line)


def cube(text: str) -> tuple[tuple[float, ...], float]:
    """The middle and the side of an option ``X,Y,Z:SIDE``, for argparse."""
    place, _, side = text.partition(":")
    return numbers(3)(place), *numbers(1)(side)


def mask(r2sego, capture: str, corners: list[tuple[float, ...]], *, declare: bool) -> None:
    """Draw a new object's mask, and give it to the bundle if asked."""
    points = " ".join(f"{x},{y}" for x, y in corners)
    r2sego.load_masks()
    r2sego.new_object(name="example")
    r2sego.draw_mask(capture=capture, points=points, tool="POLYGON")
    r2sego.draw_mask(capture=capture, points=points.split()[0], tool="BRUSH", radius=3.0, subtract=True)
    print(f"drew on {capture}: {bpy.context.scene.r2sego_proxy.objects['example'].masks} mask")
    if declare:
        r2sego.declare_masks()


def edits(r2sego, cut_box: tuple[tuple[float, ...], float] | None) -> None:
    """Cut what lies in a cube, and draw a shelf."""
    if cut_box:
        place, side = cut_box
        box = bpy.data.objects.new("example_box", None)
        box.location = place
        box.empty_display_size = side / 2
        bpy.context.scene.collection.objects.link(box)
        r2sego.select_proxy_box(box=box.name)
        r2sego.cut_proxy(name="example_cut")
    shelf = bpy.data.meshes.new("example_shelf")
    shelf.from_pydata([(0, 0, 0.8), (0.3, 0, 0.8), (0.3, 0.3, 0.8), (0, 0.3, 0.8)], [], [(0, 1, 2, 3)])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(shelf.name, shelf))
    r2sego.draw_proxy_surface(object_name="example_shelf")
    for edit in bpy.context.scene.r2sego_proxy.edits:
        print(f"edit {edit.name}: {edit.kind}, {edit.faces} faces, {edit.area:.2f} m2")


if __name__ == "__main__":
    run_script(main)
