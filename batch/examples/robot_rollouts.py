"""Declare a scene's robot and behaviour, try it on the collision surface, and play a rollout.

blender --background --python batch/examples/robot_rollouts.py -- SCENE [--region "0,0 2,0 2,1.5"] [--try 4]
python batch/examples/robot_rollouts.py -- SCENE [--robot wheeled --try 4] [--blend OUT.blend]  (pip bpy)
python batch/examples/robot_rollouts.py -- SCENE --policy student/ [--episodes 20 --episode 3]

Without --try the newest round's rollouts are played, which have to be of the declared robot. With
--policy a policy is evaluated and one of its episodes played instead; --episodes 0 plays of what was evaluated before.
"""

import argparse
import math
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon, require_in_range

from r2sego_blender.commands.scripts import numbers, run_script


def main(arguments: list[str]) -> int:
    """Declare, try, show, print and optionally save; returns 0."""
    parser = argparse.ArgumentParser(prog="robot_rollouts.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--robot", help="humanoid, wheeled, or an MJCF or URDF file")
    parser.add_argument("--scope", help="walk_and_look, sit_down, or a TOML file")
    parser.add_argument("--trust", metavar="POLICY", help="a TorchScript policy, a program, may run with your rights")
    parser.add_argument("--region", help="corners 'x,y x,y x,y' in metres, or free_floor")
    parser.add_argument("--clearance", type=float, help="metres kept from obstacles")
    parser.add_argument("--target", help="any, an object's name, or x,y: what to sit on")
    parser.add_argument(
        "--pitch", type=numbers(2), metavar="LOW,HIGH", help="pitch of the camera's bracket, degrees down"
    )
    parser.add_argument("--weights", type=numbers(2), metavar="WALK,LOOK", help="how often it walks, and looks around")
    parser.add_argument("--seats", action="store_true", help="list what could be sat on")
    parser.add_argument("--try", dest="trial", type=int, default=0, help="attempts without a round")
    parser.add_argument("--attempt", type=int, default=None, help="shown; all successful when left out")
    parser.add_argument("--policy", metavar="FOLDER|teacher", help="a training's folder, or the teacher: evaluate it")
    parser.add_argument("--episodes", type=int, default=20, help="of the policy")
    parser.add_argument("--episode", type=int, default=0, help="of the policy, shown")
    parser.add_argument("--blend", type=Path, help="save what is shown here")
    options = parser.parse_args(arguments)
    with enabled_addon():
        bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
        declare(options)
        (play_policy if options.policy else play)(options)
        if options.blend:
            bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()))
    return 0


def declare(options: argparse.Namespace) -> None:
    """Press the buttons that declare the robot, as far as options are given."""
    ops, scene = bpy.ops.r2sego, bpy.context.scene
    if options.robot in ("humanoid", "wheeled"):
        ops.choose_robot(robot=options.robot.upper())
    elif options.robot:
        ops.choose_robot(robot="FILE", filepath=str(Path(options.robot).absolute()))
    if options.trust:
        ops.trust_policy(filepath=str(Path(options.trust).absolute()))
    if options.scope in ("walk_and_look", "sit_down"):
        ops.choose_scope(scope=options.scope)
    elif options.scope:
        ops.choose_scope(scope="FILE", filepath=str(Path(options.scope).absolute()))
    if options.pitch:
        low, high = map(math.radians, options.pitch)
        ops.set_mount(mount="OWN", pitch="DRAWN", pitch_low=low, pitch_high=high)
    if options.weights:
        walk_to, look_around = options.weights
        require_in_range("set_behaviours", walk_to=walk_to, look_around=look_around)
        ops.set_behaviours(walk_to=walk_to, look_around=look_around)
    if options.target:
        ops.pick_target(target=options.target)
    if options.region == "free_floor":
        ops.clear_region()
    elif options.region:
        ops.draw_region(polygon=options.region)
    if options.clearance is not None:
        require_in_range("set_clearance", clearance=options.clearance)
        ops.set_clearance(clearance=options.clearance)
    ops.inspect_robot(seats=options.seats)
    for fact in scene.r2sego.facts:
        if fact.section == "robot":
            print(f"{fact.label}: {fact.value}")
    for seat in scene.r2sego_robot.seats:
        print(f"seat: {seat.object_name or 'no object'} at " + "({:.2f}, {:.2f})".format(*seat.place_m))


def play(options: argparse.Namespace) -> None:
    """Try some attempts where asked to, list them all, and show one, or all that succeeded."""
    ops, robot = bpy.ops.r2sego, bpy.context.scene.r2sego_robot
    if options.trial:
        require_in_range("try_rollouts", attempts=options.trial)
        ops.try_rollouts(attempts=options.trial)
    trial = robot.source == "TRIAL"
    for one in robot.attempts:
        outcome = one.outcome if one.success else f"{one.reason}, {one.outcome}"
        print(f"attempt {one.number}: {one.behaviour}, {outcome}, {one.frames} frames, {one.time_s:.1f} s")
    if options.attempt is not None:
        ops.jump_to_attempt(attempt=options.attempt, trial=trial)
    elif robot.succeeded:
        ops.show_rollout(every=True, trial=trial, look_through=True)
    moving = [shown for shown in bpy.data.objects if shown.parent is not None]
    scene = bpy.context.scene
    print(f"{len(moving)} objects follow frames 0 to {scene.frame_end}, now at {scene.frame_current}")


def play_policy(options: argparse.Namespace) -> None:
    """Evaluate the policy, list its episodes, show where they began, and one with what the head saw."""
    ops, robot = bpy.ops.r2sego, bpy.context.scene.r2sego_robot
    if options.episodes:
        policy = "" if options.policy == "teacher" else str(Path(options.policy).absolute())
        ops.evaluate_policy(policy=policy, episodes=options.episodes)
    found = robot.evaluation
    if found is None:
        raise SystemExit("no policy was evaluated here yet")
    print(f"{found.successes} of {found.episodes} succeeded [{100.0 * found.low:.0f}, {100.0 * found.high:.0f}] %")
    print(f"driven by {found.driver}, mean assist {found.mean_assist_n:.1f} N")
    for one in robot.episodes:
        print(f"episode {one.number}: {one.outcome}, {one.time_s:.1f} s")
    ops.show_policy_starts()
    ops.show_policy_episode(episode=options.episode, look_through=True)


if __name__ == "__main__":
    run_script(main)
