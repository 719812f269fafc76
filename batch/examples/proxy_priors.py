"""Say how an object's shape prior stands, move it, give the object another mesh, and decide on it.

blender --background --python batch/examples/proxy_priors.py -- SCENE --move crate=0.05,0,0 [--start]
python batch/examples/proxy_priors.py -- SCENE --mesh lamp=lamp.obj --decide lamp=accept  (pip bpy)
python batch/examples/proxy_priors.py -- SCENE --library meshes/    (--no-library withdraws it)

Moves are metres in the world. What is said here counts from the next refine on.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import assignment, numbers, run_script


def main(arguments: list[str]) -> int:
    """Move, give, decide and tell; returns 0."""
    parser = argparse.ArgumentParser(prog="proxy_priors.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--move", type=moved, action="append", default=[], metavar="OBJECT=X,Y,Z")
    parser.add_argument("--start", action="store_true", help="begin the alignment there, and do not lock it")
    parser.add_argument(
        "--mesh", type=assignment, action="append", default=[], metavar="OBJECT=FILE.obj", help="its shape"
    )
    parser.add_argument(
        "--place",
        choices=("search", "start", "lock"),
        default="search",
        help="where that goes: looked for, from where the file has it, or there",
    )
    parser.add_argument(
        "--decide", type=assignment, action="append", default=[], metavar="OBJECT=accept|reject|reconsider|lock|unlock"
    )
    library = parser.add_mutually_exclusive_group()
    library.add_argument("--library", type=Path, metavar="FOLDER", help="of meshes that shapes are looked for in")
    library.add_argument("--no-library", action="store_true", help="look in no folder any more")
    options = parser.parse_args(arguments)
    with enabled_addon():
        r2sego = bpy.ops.r2sego
        r2sego.open_scene(directory=str(options.scene.absolute()))
        r2sego.show_priors()
        for name, metres in options.move:
            move(name, metres, locked=not options.start)
        for name, file in options.mesh:
            bpy.ops.wm.obj_import(filepath=str(Path(file).absolute()), forward_axis="Y", up_axis="Z")
            r2sego.use_mesh_as_prior(object_name=name, place=options.place.upper())
        if options.library or options.no_library:
            folder = str(options.library.absolute()) if options.library else ""
            r2sego.choose_mesh_library(directory=folder, withdraw=options.no_library)
        for name, decision in options.decide:
            r2sego.decide_prior(object_name=name, decision=decision)
        for one in bpy.context.scene.r2sego_proxy.objects:
            mesh = "its own mesh" if one.own_mesh else one.shape or "no mesh yet"
            print(f"{one.name}: {one.state}, {mesh}, {one.masks} masks" + f"; {one.why}" * bool(one.why))
    return 0


def moved(text: str) -> tuple[str, tuple[float, ...]]:
    """An option ``OBJECT=X,Y,Z``."""
    name, metres = assignment(text)
    return name, numbers(3)(metres)


def move(name: str, metres: tuple[float, ...], *, locked: bool) -> None:
    """Move an object's prior, tell how it fits the masks before and after, and keep it there."""
    r2sego, group = bpy.ops.r2sego, bpy.context.scene.r2sego_proxy
    r2sego.place_prior(object_name=name)
    before = group.fit_iou
    prior = bpy.context.view_layer.objects.active
    prior.location = [here + by for here, by in zip(prior.location, metres, strict=True)]
    bpy.context.view_layer.update()  # the fit follows
    r2sego.save_placement(object_name=name, locked=locked)
    apart = f"{group.fit_residual * 1000:.1f} mm from its points" if group.fit_residual >= 0.0 else "no points"
    print(f"{name}: overlap {before:.2f} before, {group.fit_iou:.2f} after, {apart}")


if __name__ == "__main__":
    run_script(main)
