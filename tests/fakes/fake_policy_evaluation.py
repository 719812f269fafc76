"""A policy's recorded evaluation made by hand: three episodes of a real small robot, two of which fail."""

from pathlib import Path

import numpy as np
from fake_rollouts import ROBOT, rollouts

from r2sego_blender.core.images import save_image
from r2sego_blender.results.policy_evaluation import PolicyEvaluation, head_folder, picture_name
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import save_bodies
from r2sego_blender.robot.rollouts.rollout import save_rollouts

FRAMES = (11, 5, 8)
PICTURED = (0, 1)
EVALUATION = PolicyEvaluation(
    policy="/trainings/student",
    driver="made up by hand",
    asset="",
    reference="",
    chairs=(),
    successes=1,
    episodes=3,
    low=0.0084,
    high=0.9057,
    failures={"no_goal": 1, "body_contact": 1},
    mean_assist_n=14.5,
)


def head_level(number: int, frame: int) -> int:
    """The level of all pixels that the head saw then."""
    return 40 * number + 10 * frame


def fill_policy(folder: Path) -> None:
    """A bundle's ``robot/policy``."""
    robot, place = RobotModel.load(ROBOT), folder / "robot" / "policy"
    place.mkdir(parents=True)
    episodes = rollouts(robot, FRAMES)
    save_rollouts(place, episodes)
    save_bodies(place, robot, episodes, robot.camera(128, 96), place)
    for number in PICTURED:
        head_folder(place, number).mkdir(parents=True)
        for frame in range(FRAMES[number]):
            picture = np.full((96, 128, 3), head_level(number, frame), np.uint8)
            save_image(head_folder(place, number) / picture_name(frame), picture)
    EVALUATION.save(place)
