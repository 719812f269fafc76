"""Show a scene's asset, delete the splats of a box, render it from a capture, and write it.

blender --background --python batch/examples/asset_cleaning.py -- SCENE --to FOLDER
python batch/examples/asset_cleaning.py -- SCENE --to FOLDER --delete -0.5 -0.5 0 0.5 0.5 1  (pip bpy)

What is deleted stays so when the scene is refined again; --restore NAME brings it back.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from capture_lasso import lasso_through
from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.splats.formats.registry import MENU


def main(arguments: list[str]) -> int:
    """Press the room's buttons; returns 0."""
    parser = argparse.ArgumentParser(prog="asset_cleaning.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--to", type=Path, required=True, help="folder for the pictures and the asset")
    parser.add_argument("--round", default="", help="initial, a round from 0, or final")
    parser.add_argument("--delete", nargs=6, type=float, metavar="M", help="a box: lowest, highest corner")
    parser.add_argument("--lasso", type=float, metavar="M", help="delete what fills the image, so near")
    parser.add_argument("--fainter", type=float, metavar="SHARE", help="delete what is less opaque")
    parser.add_argument("--name", default="", help="what the deletion is called")
    parser.add_argument("--restore", metavar="NAME", help="bring the splats of a deletion back")
    parser.add_argument(
        "--format", default=".spz", choices=[suffix for suffix, *_ in MENU], help="suffix of the asset's file"
    )
    options = parser.parse_args(arguments)
    with enabled_addon():
        _clean(options)
    return 0


def _clean(options: argparse.Namespace) -> None:
    r2sego = bpy.ops.r2sego
    options.to.mkdir(parents=True, exist_ok=True)  # before anything is deleted
    r2sego.open_scene(directory=str(options.scene.absolute()))
    r2sego.import_captures(points=False)
    scene, group = bpy.context.scene, bpy.context.scene.r2sego_asset
    if options.restore:
        r2sego.restore_splats(name=options.restore)
    r2sego.show_asset(stage=options.round)
    if options.delete:
        r2sego.mark_splats_box(lowest=options.delete[:3], highest=options.delete[3:])
    if options.lasso:
        _mark_with_lasso(scene.camera.name, options.lasso)
    if options.fainter:
        _select_fainter(group.shown, options.fainter)
        r2sego.mark_selected_splats(cell=0.005)
    if group.marks:
        print(f"deleting {group.marked} splats")
        r2sego.delete_splats(name=options.name)
    r2sego.compare_photograph(side="LEFT")
    r2sego.render_asset(camera=scene.camera.name, stage=options.round, place="RIGHT")
    r2sego.move_wipe(factor=0.5)  # seen where there is a window
    picture = group.wipe_right
    picture.save(filepath=str(options.to.absolute() / "asset.png"))
    print(f"{picture.name}: {picture.size[0]} x {picture.size[1]}, beside {group.wipe_left.name}")
    file = options.to.absolute() / "asset.ply"
    r2sego.export_asset(filepath=str(file), file_format=options.format, stage=options.round)
    for stage in group.stages:
        print(f"{stage.label}: {stage.gaussians} splats")
    for edit in group.edits:
        print(f"deleted in {edit.name}: {edit.regions}")


def _mark_with_lasso(capture: str, far_m: float) -> None:
    """Mark what a capture's image shows, but for its edges, up to ``far_m`` away."""
    width, height = bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y
    left, top, right, bottom = 0.05 * width, 0.05 * height, 0.95 * width, 0.95 * height
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    bpy.ops.r2sego.mark_splats_lasso(**lasso_through(capture, corners), far=far_m)


def _select_fainter(shown: bpy.types.Object, share: float) -> None:
    """Select the vertices whose opacity is below ``share``."""
    vertices = shown.data.vertices
    opacity = [0.0] * len(vertices)
    shown.data.attributes["opacity"].data.foreach_get("value", opacity)
    vertices.foreach_set("select", [value < share for value in opacity])


if __name__ == "__main__":
    run_script(main)
