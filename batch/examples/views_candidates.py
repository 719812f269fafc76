"""Show a round's candidate views, say why some are targets and others not, and look through one.

blender --background --python batch/examples/views_candidates.py -- SCENE [--blend OUT.blend]
python batch/examples/views_candidates.py -- SCENE [--candidate 17]  (pip bpy)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Show, print and optionally save; returns 0."""
    parser = argparse.ArgumentParser(prog="views_candidates.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--round", type=int, default=None, help="from 0; the last one when left out")
    parser.add_argument("--candidate", type=int, default=None, help="looked through; the best when left out")
    parser.add_argument("--colour", choices=("s", "u", "g"), default="s", help="what the frusta's colours mean")
    parser.add_argument("--blend", type=Path, help="save what is shown here")
    options = parser.parse_args(arguments)
    with enabled_addon():
        show(options)
    return 0


def show(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    scene = bpy.context.scene
    bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
    if options.round is not None:
        scene.r2sego.round_index = options.round
    bpy.ops.r2sego.show_candidates(colour_by=options.colour.upper(), shown="SURVIVORS")
    views = scene.r2sego_views
    scores = views.scores
    print(f"{scores.survivors} of {len(scores)} candidates survive, best score {scores.best['S']:.3f}")
    for place, row in enumerate(views.ranked, 1):
        bpy.ops.r2sego.pick_candidate(candidate=row.candidate)
        print(f"{place}. rollout {row.rollout}, frame {row.frame}: {views.figures}\n   {views.why}")
    chosen = options.candidate if options.candidate is not None else views.ranked[0].candidate
    bpy.ops.r2sego.pick_candidate(candidate=chosen)
    bpy.ops.r2sego.look_through_candidate()
    print(f"looking through candidate {chosen}: {views.why}")
    for number, photograph in enumerate(scores.selection.photographs):
        bpy.ops.r2sego.look_through_photograph(photograph=number)
        print(f"photograph to take {number + 1}: {photograph.in_words()}")
    if options.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()))


if __name__ == "__main__":
    run_script(main)
