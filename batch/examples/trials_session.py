"""Plan a study of trials or open one, show a trial's poses, run a session, or tell the one that runs.

blender --background --python batch/examples/trials_session.py -- DECLARATION.toml --run
python batch/examples/trials_session.py -- STUDY.trials --trial 3 --to poses.blend  (pip bpy)
python batch/examples/trials_session.py -- STUDY.trials --tell NOTE --text "chair moved by 2 cm"

A session of --run has a simulated device unless --device and --calibration name a real one.
"""

import argparse
import math
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Do what is asked, and tell what became of it; returns 0."""
    parser = argparse.ArgumentParser(prog="trials_session.py", description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="NAME.trials, or the TOML file that declares one")
    parser.add_argument("--trial", type=int, default=0, metavar="NUMBER", help="whose poses; without, the next one's")
    parser.add_argument("--to", type=Path, help="a .blend to write them to")
    parser.add_argument("--page", action="store_true", help="write the printable page")
    parser.add_argument("--run", action="store_true", help="run a session to its end")
    parser.add_argument("--device", default="", help="where a real device is")
    parser.add_argument("--calibration", default="", help="its calibration")
    parser.add_argument("--tell", metavar="CONTROL", help="tell the running session: ARM, START, END, NOTE, ...")
    parser.add_argument("--text", default="", help="with it, or why it is judged or ended so")
    parser.add_argument("--judge", metavar="OUTCOME", help="judge the last trial: SUCCESS, FAILURE or UNUSABLE")
    parser.add_argument("--by", default="", help="who judges")
    parser.add_argument("--end", metavar="REASON", help="end the study")
    options = parser.parse_args(arguments)
    with enabled_addon():
        work(options)
    return 0


def work(options: argparse.Namespace) -> None:
    """Press the room's buttons one after the other."""
    r2sego, trials = bpy.ops.r2sego, bpy.context.scene.r2sego_trials
    if options.study.suffix == ".toml":
        r2sego.plan_trials(filepath=str(options.study.absolute()))
    else:
        r2sego.open_study(directory=str(options.study.absolute()), show=False)
    plan = trials.facts.plan
    print(f"{plan.name}: {len(plan.trials)} trials, plan {plan.digest}")
    if options.tell:
        r2sego.tell_session(control=options.tell, text=options.text)
    if options.judge:
        r2sego.judge_trial(outcome=options.judge, by=options.by, text=options.text)
    if options.page:
        r2sego.open_trials_page()
    if options.run:
        trials.simulated, trials.device, trials.calibration = not options.device, options.device, options.calibration
        r2sego.run_trials()
    if options.end:
        r2sego.end_study(reason=options.end)
    if trials.facts.next is not None or options.trial:
        r2sego.show_trial_poses(number=options.trial)
        for one in (one for one in bpy.data.objects if one.type == "CURVE"):
            x, y, _ = one.location
            print(f"{one.name}: {x:.4f} {y:.4f} m, {math.degrees(one.rotation_euler.z):.4f} degrees")
    if options.to:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.to.absolute()))


if __name__ == "__main__":
    run_script(main)
