"""List a round's generated views, decide on some, and write their pictures side by side.

blender --background --python batch/examples/generation_views.py -- SCENE --to FOLDER [--reject 3]
python batch/examples/generation_views.py -- SCENE --to FOLDER [--render]  (pip bpy)

--accept and --reject are kept in the bundle and count from the next refine on.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import SceneError


def main(arguments: list[str]) -> int:
    """Decide, print and write; returns 0."""
    parser = argparse.ArgumentParser(prog="generation_views.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--to", type=Path, required=True, help="folder for the pictures and view.blend")
    parser.add_argument("--round", type=int, default=None, help="from 0; the last one when left out")
    for decision in ("accept", "reject", "undecided"):
        parser.add_argument(f"--{decision}", type=int, action="append", default=[], metavar="K")
    parser.add_argument("--render", action="store_true", help="render the asset from the views first")
    parser.add_argument("--conditions", type=int, metavar="PERCENT", help="render them along the first clip's path")
    parser.add_argument("--truth", type=Path, help="cameras.json with frozen views to stand beside")
    options = parser.parse_args(arguments)
    with enabled_addon():
        show(options)
    return 0


def show(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    scene, r2sego = bpy.context.scene, bpy.ops.r2sego
    r2sego.open_scene(directory=str(options.scene.absolute()))
    if options.round is not None:
        scene.r2sego.round_index = options.round
    for decision in ("accept", "reject", "undecided"):
        for rank in getattr(options, decision):
            r2sego.decide_view(view=rank, decision=decision.upper())
    if options.render:
        for when in ("BEFORE", "AFTER"):
            r2sego.render_target_views(when=when)
    group = scene.r2sego_generation
    if not len(group.views):
        raise SceneError("this round has no generated views", cure="Run Refine, or choose another round.")
    options.to.mkdir(parents=True, exist_ok=True)
    with_clips = [view.rank for view in group.views if view.has_clip]
    for view in group.views:
        mark = "accepted" if view.accepted else "rejected"
        print(f"view {view.rank}: {mark}, {view.fate}; {view.residual or 'no pose'}; {view.replacement}")
    for rank in with_clips:
        r2sego.compare_view(view=rank, truth=str(options.truth.absolute()) if options.truth else "")
        image = bpy.data.images["R2S-EGO Side by Side"]
        image.filepath_raw, image.file_format = str(options.to.absolute() / f"{rank:03d}.png"), "PNG"
        image.save()
        print(f"{image.filepath_raw}: {', '.join(image['parts'])}")
    if with_clips:
        if options.conditions is not None:
            folder = options.to.absolute() / "conditions"
            require_in_range("render_conditions", scale=options.conditions)
            r2sego.render_conditions(view=with_clips[0], directory=str(folder), scale=options.conditions)
            print(f"{folder}: {len(list(folder.glob('*.exr')))} frames")
        r2sego.show_camera_path(view=with_clips[0])
        r2sego.play_clip(view=with_clips[0])
        bpy.ops.wm.save_as_mainfile(filepath=str(options.to.absolute() / "view.blend"))


if __name__ == "__main__":
    run_script(main)
