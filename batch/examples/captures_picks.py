"""Say what each picked point and each known length does to a registration, and correct without some.

blender --background --python batch/examples/captures_picks.py -- SCENE --picks FILE.json
python batch/examples/captures_picks.py -- SCENE --picks FILE.json --without C --correct  (pip bpy)

For each it prints the worst miss that is left without it: the pick that is wrong stands out.
FILE.json is that of `r2sego register --picks` (docs/formats.md).
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from captures_registration import pick, tell
from enabled_addon import enabled_addon

from r2sego_blender.captures.frame.picks import Picks
from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import CaptureError


def main(arguments: list[str]) -> int:
    """Try without each, leave out, tell and correct; returns 0."""
    parser = argparse.ArgumentParser(prog="captures_picks.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--picks", type=Path, required=True, help="points, lengths and camera heights")
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="POINT[:CAPTURE]|FROM-TO",
        help="leave out a point, its pick in a capture, or a length",
    )
    parser.add_argument("--correct", action="store_true", help="move the scene as the others say")
    parser.add_argument("--to", type=Path, help="save a .blend that looks through the worst pick's capture")
    options = parser.parse_args(arguments)
    picks = Picks.load(options.picks).to_json()
    with enabled_addon():
        bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
        bpy.ops.r2sego.import_captures(points=False)
        shown = bpy.context.scene.r2sego_captures
        pick(picks)
        for one in [point.name for point in shown.points] + [span(length) for length in shown.lengths]:
            leave_out(one)
            print(f"without {one}: {misses(shown)}")
            if shown.points:  # it was not the only one
                bpy.ops.r2sego.remove_pick(everything=True)
            pick(picks)
        for one in options.without:
            leave_out(one)
        tell(shown)
        look_at_worst(shown)
        if options.correct:
            bpy.ops.r2sego.correct_registration(by="PICKS")
        if options.to is not None:
            bpy.ops.wm.save_as_mainfile(filepath=str(options.to.absolute()))
    return 0


def leave_out(what: str) -> None:
    """Remove a point, its pick in one capture, or a length. Raises CaptureError when there is none."""
    lengths = [span(length) for length in bpy.context.scene.r2sego_captures.lengths]
    point, _, capture = what.partition(":")
    if what in lengths:
        bpy.ops.r2sego.remove_length(index=lengths.index(what))
    elif point in bpy.context.scene.r2sego_captures.points:
        bpy.ops.r2sego.remove_pick(point=point, capture=capture)
    else:
        raise CaptureError(f"'{what}' is no point and no length", cure="Name one of the file.")


def span(length) -> str:
    """What a length is called here."""
    return f"{length.start}-{length.end}"


def misses(shown) -> str:
    """The worst of what the fit leaves."""
    if shown.fit_problem:
        return shown.fit_problem
    placed = [point.placed for point in shown.points if point.placed is not None]
    parts = [f"{max((one.off_px for one in placed), default=0.0):.2f} px"]
    if any(point.floor for point in shown.points):
        parts.append(f"{max(abs(one.off_floor_m) for one in placed) * 100:.1f} cm off the floor")
    if len(shown.lengths):
        parts.append(f"{max(abs(length.error_m) for length in shown.lengths) * 100:.1f} cm in lengths")
    return ", ".join(parts)


def look_at_worst(shown) -> None:
    """Look through the capture in which a pick is off most."""
    picks = [
        (off_px, point.name, view.capture)
        for point in shown.points
        if point.placed is not None
        for off_px, view in zip(point.placed.off_each_px, point.views, strict=True)
    ]
    if not picks:
        return
    off_px, point, capture = max(picks)
    bpy.context.view_layer.objects.active = bpy.data.objects[capture]
    bpy.ops.r2sego.look_through()
    print(f"the worst pick is that of {point} in {capture}, {off_px:.2f} px off")


if __name__ == "__main__":
    run_script(main)
