"""Import captures, show what was picked in them, and correct ground and scale by it.

blender --background --python batch/examples/captures_registration.py -- SCENE [--picks FILE.json]
python batch/examples/captures_registration.py -- SCENE --picks FILE.json --correct  (pip bpy)

FILE.json is that of `r2sego register --picks` (docs/formats.md). --frame places the arrows that
become the world, x y z in metres and a turn about z in degrees; --undo takes a correction back.
"""

import argparse
import math
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.captures.frame.picks import Picks
from r2sego_blender.captures.frame.picks_fit import in_centimetres
from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Pick, tell and correct; returns 0."""
    parser = argparse.ArgumentParser(prog="captures_registration.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--picks", type=Path, help="points, lengths and camera heights")
    parser.add_argument("--correct", action="store_true", help="move the scene as the picks say")
    parser.add_argument("--frame", type=float, nargs=4, metavar=("X", "Y", "Z", "TURN"))
    parser.add_argument("--undo", action="store_true", help="take the last correction back")
    parser.add_argument("--to", type=Path, help="save what is shown as a .blend")
    options = parser.parse_args(arguments)
    with enabled_addon():
        show(options)
    return 0


def show(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    r2sego = bpy.ops.r2sego
    r2sego.open_scene(directory=str(options.scene.absolute()))
    r2sego.import_captures()
    shown = bpy.context.scene.r2sego_captures
    for one in shown.captures:
        print(
            f"{one.name}: {one.width}x{one.height}, {one.view_deg:.1f} degrees wide, "
            f"{one.points} points, overlaps {one.overlaps}"
        )
        r2sego.look_through_next()
    if options.picks is not None:
        pick(Picks.load(options.picks).to_json())
        tell(shown)
    if options.correct:
        r2sego.correct_registration(by="PICKS")
    if options.frame is not None:
        r2sego.place_frame()
        arrows, (*place, turn_deg) = bpy.context.view_layer.objects.active, options.frame
        arrows.location, arrows.rotation_euler.z = place, math.radians(turn_deg)
        r2sego.correct_registration(by="FRAME")
    if options.undo:
        r2sego.undo_correction()
    for residual in shown.residuals:
        print(f"after: {residual.text}")
    first = shown.captures[0].name
    print(f"{first} stands at {tuple(round(x, 4) for x in bpy.data.objects[first].location)}")
    print(f"{shown.corrections} corrections can be taken back")
    if options.to is not None:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.to.absolute()))


def pick(picks: dict) -> None:
    """What a person would click and type."""
    r2sego, shown = bpy.ops.r2sego, bpy.context.scene.r2sego_captures
    for point in picks.get("points", ()):
        for view in point["views"]:
            r2sego.pick_point(point=point["name"], floor=point.get("floor", False), **view)
    for length in picks.get("lengths", ()):
        require_in_range("add_length", metres=length["metres"])
        r2sego.add_length(start=length["from"], end=length["to"], metres=length["metres"])
    for height in picks.get("camera_heights", ()):
        require_in_range("new_scene", camera_height=height["metres"])  # the same range
        shown.height_capture, shown.camera_height = height["capture"], height["metres"]
        shown.use_camera_height = True


def tell(shown) -> None:
    """The residuals before anything is moved."""
    for point in shown.points:
        placed = point.placed
        if placed is None:
            continue
        off = f"{placed.off_px:.2f} px off" if placed.off_px >= 0.0 else "in one photograph"
        floor = f", {in_centimetres(placed.off_floor_m)} off the floor" if point.floor else ""
        print(f"{point.name}: {off}{floor}")
    for length in shown.lengths:
        error = "" if length.error_m is None else f", {in_centimetres(length.error_m)}"
        print(f"{length.start} to {length.end}: {length.metres:.3f} m{error}")
    print(shown.fit_problem or f"{shown.fit_said}; {shown.fit_warning}".rstrip("; "))


if __name__ == "__main__":
    run_script(main)
