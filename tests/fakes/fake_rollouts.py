"""Rollouts of a real small robot for the fake bundle: what moves is made up, what is written is not."""

import json
from pathlib import Path

import numpy as np

from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import save_bodies
from r2sego_blender.robot.rollouts.rollout import Rollout, save_rollouts

ROBOT = "embedded:wheeled"
FRAMES = (11, 5, 0, 8)
"""Of each attempt; the second and the third fail."""
_FAILURES = {1: ("body_contact", "mast touched the chair"), 2: ("no_goal", "no place lies in the ranges")}


def rollouts(robot: RobotModel, of_frames: tuple[int, ...] = FRAMES) -> list[Rollout]:
    """Attempts of so many frames each along an arc, the camera pitched differently in each."""
    made = []
    for number, frames in enumerate(of_frames):
        turn = np.linspace(0.0, 0.3 * (number + 1), frames)
        qpos = np.tile(robot.rest_qpos, (frames, 1))
        qpos[:, 0] += np.sin(turn) + 0.1 * number
        qpos[:, 1] += 1.0 - np.cos(turn)
        qpos[:, 3], qpos[:, 6] = np.cos(turn / 2.0), np.sin(turn / 2.0)
        qpos[:, 7:] += turn[:, None]
        reason, detail = _FAILURES.get(number, ("", ""))
        made.append(
            Rollout(
                success=not reason,
                reason=reason,
                frame=max(frames - 1, 0),
                qpos=qpos,
                times_s=0.2 * np.arange(frames),
                camera_poses=robot.camera_poses(qpos, robot.mount.pitched(20.0 + 5.0 * number)),
                seed=(0, number),
                behaviour="walk_to" if frames else "",
                detail=detail,
                controller="reference motions",
            )
        )
    return made


def fill_rollouts(folder: Path, index: int) -> None:
    """A round's rollouts, and for the first round the robot's bodies along them."""
    robot = RobotModel.load(ROBOT)
    (folder / "rollouts").mkdir()
    save_rollouts(folder / "rollouts", rollouts(robot))
    if index == 0:
        (folder / "bodies").mkdir()
        save_bodies(folder / "bodies", robot, rollouts(robot), robot.camera(64, 48), folder / "rollouts")


def fill_trial(folder: Path) -> None:
    """The trial's two attempts, their bodies, and what the engine said of the robot."""
    robot, trial = RobotModel.load(ROBOT), folder / "robot" / "trial"
    trial.mkdir(parents=True)
    save_rollouts(trial, rollouts(robot)[:2])
    save_bodies(trial, robot, rollouts(robot)[:2], robot.camera(64, 48), trial)
    seat = {"place_m": [0.5, -0.25], "height_m": 0.45, "yaw_deg": 90.0, "places": 3, "object": "chair"}
    told = {
        "declared": ["embedded:humanoid", "walk_and_look"],
        "joints": 29,
        "legs": 2,
        "wheels": 0,
        "height_m": 1.31,
        "mass_kg": 35.1,
        "camera": {"height_m": 1.27, "pitch_deg": 47.6, "fov_deg": 55.0, "fov_is_vertical": True},
        "seats": [seat, {**seat, "place_m": [-1.0, 0.75], "object": "", "places": 1}],
    }
    (folder / "robot" / "robot.json").write_text(json.dumps(told))
