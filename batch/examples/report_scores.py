"""Print what an evaluation came to: arms, rounds and causes of error.

blender --background --python batch/examples/report_scores.py -- SCENE
python batch/examples/report_scores.py -- SCENE --frozen cameras.json  (pip bpy; evaluates first)
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script
from r2sego_blender.core.errors import SceneError


def main(arguments: list[str]) -> int:
    """Evaluate if asked, and print; returns 0."""
    parser = argparse.ArgumentParser(prog="report_scores.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--frozen", type=Path, help="frozen views to score on first")
    options = parser.parse_args(arguments)
    with enabled_addon():
        show(options)
    return 0


def show(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    r2sego = bpy.ops.r2sego
    r2sego.open_scene(directory=str(options.scene.absolute()))
    if options.frozen is not None:
        r2sego.evaluate(filepath=str(options.frozen.absolute()))
    report = bpy.context.scene.r2sego_report
    if not len(report.arms):
        raise SceneError("this scene has not been evaluated", where=options.scene, cure="Give --frozen.")
    for score in (*report.arms, *report.rounds):
        figures = [figure(score.psnr, ".2f"), figure(score.ssim, ".3f"), figure(score.lpips, ".3f")]
        print(f"{score.label:<16}" + "".join(f"{text:>9}" for text in figures) + f"  {score.note}".rstrip())
    for cause in report.causes:
        shares = f"{figure(cause.error, '.0%'):>6} of the error"
        print(f"{cause.label:<24}{shares}, {figure(cause.pixels, '.0%')} of the pixels")
    r2sego.open_report()


def figure(value: float | None, form: str) -> str:
    """A number, or n/a where it is not known."""
    return "n/a" if value is None else format(value, form)


if __name__ == "__main__":
    run_script(main)
