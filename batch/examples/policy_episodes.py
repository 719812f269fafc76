"""Evaluate a policy in a refined scene, show where its episodes began, and play one with what its head saw.

blender --background --python batch/examples/policy_episodes.py -- SCENE [--policy FOLDER] [--episodes 20]
python batch/examples/policy_episodes.py -- SCENE [--episode 3] [--blend OUT.blend]  (pip bpy)

Without --policy the teacher is evaluated; with --episodes 0 what was recorded before is shown.
"""

import argparse
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Evaluate, show, print and optionally save; returns 0."""
    parser = argparse.ArgumentParser(prog="policy_episodes.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--policy", type=Path, help="a training's folder; the teacher when left out")
    parser.add_argument("--episodes", type=int, default=20, help="how many are tried")
    parser.add_argument("--seed", type=int, default=0, help="what they are drawn by")
    parser.add_argument("--episode", type=int, default=0, help="the one that is shown")
    parser.add_argument("--blend", type=Path, help="save what is shown here")
    options = parser.parse_args(arguments)
    with enabled_addon():
        ops, scene = bpy.ops.r2sego, bpy.context.scene
        ops.open_scene(directory=str(options.scene.absolute()))
        if options.episodes:
            policy = str(options.policy.absolute()) if options.policy else ""
            ops.evaluate_policy(policy=policy, episodes=options.episodes, seed=options.seed)
        found = scene.r2sego_robot.evaluation
        print(f"{found.successes} of {found.episodes} succeeded [{100 * found.low:.0f}, {100 * found.high:.0f}] %")
        print(f"driven by {found.driver}, mean assist {found.mean_assist_n:.1f} N")
        for one in scene.r2sego_robot.episodes:
            print(f"episode {one.number}: {one.outcome}, {one.time_s:.1f} s")
        ops.show_policy_starts()
        ops.show_policy_episode(episode=options.episode, look_through=True)
        if options.blend:
            bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()))
    return 0


if __name__ == "__main__":
    run_script(main)
