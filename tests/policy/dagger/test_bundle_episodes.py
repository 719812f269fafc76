"""The teacher in a bundle's own environment: it sits down in the physics, and is recorded as it is seen."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra `policy` is not installed")

from training_room import training_room

from r2sego_blender.policy.dagger.acting import labelled_episode
from r2sego_blender.policy.dagger.bundle_episodes import BundleEpisodes
from r2sego_blender.policy.dagger.settings import DaggerSettings
from r2sego_blender.policy.environment.environments import SitEnv
from r2sego_blender.policy.student.targets import PICTURE_SHAPE
from r2sego_blender.robot.controllers.commanded_drive import DriveLimits


def test_the_teacher_sits_down_in_a_bundle_and_each_step_is_recorded(tmp_path):
    env = SitEnv(training_room(tmp_path / "room.r2s"))
    episodes = BundleEpisodes(env)
    episode = labelled_episode(episodes, episodes, None, 1.0, 3, DaggerSettings(), DriveLimits())
    assert episode.outcome.failure == ""
    assert episode.outcome.steps == len(episode) == len(episode.pictures)
    assert 0.0 < episode.outcome.mean_assist_n < 60.0
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(episode.pictures[0], observation["head"])
    np.testing.assert_array_equal(episode.proprio[0], observation["proprio"])
    assert episode.pictures.shape[1:] == PICTURE_SHAPE
    # Last of all it sits, and the seat is right behind it.
    assert (episode.actions[-10:] == [0.0, 0.0, 0.0, 1.0]).all()
    distance_m, *_, heading_cos, in_view = episode.seat[-1]
    assert distance_m < 0.4
    assert heading_cos > 0.98
    assert not in_view
    # The last action is felt, and is what the teacher said before.
    np.testing.assert_allclose(episode.proprio[1:, -4:], episode.actions[:-1], atol=1e-6)
