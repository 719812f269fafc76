"""DAgger on a toy: it learns from pictures, goes on to the bit after Ctrl-C, and pairs share all but pictures."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import dot_environment
import numpy as np
import pytest
import torch
from dot_environment import DotEnvironment, DotTeacher

from r2sego_blender.core.errors import MachineError, SettingsError
from r2sego_blender.core.progress import Progress, Task
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb
from r2sego_blender.policy.dagger.acting import Actor, outcomes, taught_outcomes
from r2sego_blender.policy.dagger.checkpoints import load_settings, load_student
from r2sego_blender.policy.dagger.episodes import EpisodeStore
from r2sego_blender.policy.dagger.evaluation import Evaluation
from r2sego_blender.policy.dagger.loop import CHECKPOINT, episode_seed, train_student
from r2sego_blender.policy.dagger.settings import DaggerSettings
from r2sego_blender.robot.controllers.commanded_drive import DriveLimits

pytest.importorskip("tensorboardX", reason="the extra `policy` is not installed")

SHORT = DaggerSettings(
    teacher_episodes=4,
    views=6,
    eye_epochs=2,
    iterations=1,
    episodes=3,
    epochs=2,
    pictures=8,
    sequences=2,
    window_steps=3,
)
ROOT = Path(__file__).parents[3]
ENDLESS = """
import signal, sys
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs tests in the background ignores it
from dot_environment import DotEnvironment, DotTeacher
from r2sego_blender.policy.dagger.loop import train_student
from r2sego_blender.policy.dagger.settings import DaggerSettings
settings = DaggerSettings(teacher_episodes=8, views=8, eye_epochs=1, iterations=0, epochs=10_000)
train_student(DotEnvironment(0), DotTeacher(), settings, Path(sys.argv[1]))
"""
UNSEEN = range(2**33, 2**33 + 40)


class Interrupting(Progress):
    """Ctrl-C at the unit ``at`` of all tasks."""

    def __init__(self, at: int) -> None:
        self._left = at

    def task(self, title, total):
        outer = self

        class Counting(Task):
            def advance(self, units: int = 1) -> None:
                outer._left -= 1
                if outer._left == 0:
                    raise KeyboardInterrupt

        class Manager:
            def __enter__(self):
                return Counting(title, total)

            def __exit__(self, *_):
                return False

        return Manager()


def trained(folder: Path, settings: DaggerSettings = SHORT, hue: int = 0, progress: Progress | None = None) -> bytes:
    """The checkpoint of a whole training, byte for byte."""
    train_student(DotEnvironment(hue), DotTeacher(), settings, folder, progress=progress or Progress())
    return (folder / CHECKPOINT).read_bytes()


def test_the_student_learns_from_pictures_what_the_teacher_knows(tmp_path):
    settings = DaggerSettings(
        teacher_episodes=16,
        iterations=2,
        episodes=8,
        epochs=15,
        pictures=16,
        sequences=4,
        window_steps=12,
        learning_rate=2e-3,
        views=500,
        sit_weight=1.0,
    )
    student = train_student(DotEnvironment(), DotTeacher(), settings, tmp_path)
    assert Evaluation.of(taught_outcomes(DotEnvironment(), DotTeacher(), DriveLimits(), UNSEEN)).rate == 1.0
    evaluation = Evaluation.of(outcomes(DotEnvironment(), student, UNSEEN))
    assert evaluation.rate > 0.9, str(evaluation)
    assert evaluation.mean_assist_n == 3.0
    blind = Evaluation.of(outcomes(DotEnvironment(hue=1), student, UNSEEN))
    assert blind.rate < evaluation.rate


@pytest.mark.parametrize("at", [2, 6, 9, 12])
def test_a_training_that_was_cut_off_goes_on_to_the_same_bits(tmp_path, undisturbed, at):
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path, progress=Interrupting(at))
    assert (tmp_path / CHECKPOINT).read_bytes() != undisturbed[1]
    assert trained(tmp_path) == undisturbed[1]
    for number in range(7):
        ours, theirs = (EpisodeStore(folder / "episodes")[number] for folder in (tmp_path, undisturbed[0]))
        assert ours.outcome == theirs.outcome
        np.testing.assert_array_equal(ours.pictures, theirs.pictures)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[Path, bytes]:
    folder = tmp_path_factory.mktemp("undisturbed")
    return folder, trained(folder)


def test_a_finished_training_is_not_trained_again(undisturbed):
    before = (undisturbed[0] / CHECKPOINT).stat().st_mtime_ns
    student = train_student(DotEnvironment(), DotTeacher(), SHORT, undisturbed[0])
    assert (undisturbed[0] / CHECKPOINT).stat().st_mtime_ns == before
    observation, _ = DotEnvironment().reset(1)
    kept = load_student(undisturbed[0] / CHECKPOINT)
    np.testing.assert_array_equal(Actor(student).act(observation), Actor(kept).act(observation))


def test_pairs_share_initial_weights_and_the_teacher_s_episodes_and_differ_in_pictures_alone(tmp_path):
    settings = DaggerSettings(teacher_episodes=5, views=4, eye_epochs=1, iterations=0, epochs=1, learning_rate=1e-6)
    trained(tmp_path / "red", settings, hue=0)
    trained(tmp_path / "green", settings, hue=1)
    for number in range(5):
        red, green = (EpisodeStore(tmp_path / arm / "episodes")[number] for arm in ("red", "green"))
        assert red.outcome == green.outcome
        assert red.outcome.seed == episode_seed(settings, number)
        for part in ("proprio", "actions", "seat"):
            np.testing.assert_array_equal(getattr(red, part), getattr(green, part))
        assert (red.pictures != green.pictures).any()
    weights = [load_student(tmp_path / arm / CHECKPOINT).state_dict() for arm in ("red", "green")]
    for name, tensor in weights[0].items():  # a pass at such a rate changes next to nothing
        torch.testing.assert_close(tensor, weights[1][name], atol=1e-5, rtol=0.0)


def test_other_seeds_have_other_weights_and_episodes():
    seeds = {episode_seed(DaggerSettings(seed=seed), number) for seed in range(20) for number in range(100)}
    assert len(seeds) == 2000


@pytest.mark.skipif(os.name == "nt", reason="a process there is not sent Ctrl-C alone")
def test_ctrl_c_ends_it_at_once_with_nothing_half_written(tmp_path):
    folder = tmp_path / "training"
    paths = os.pathsep.join([str(ROOT), str(Path(dot_environment.__file__).parent)])
    command = [sys.executable, "-c", ENDLESS, str(folder)]
    process = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": paths}, stderr=subprocess.PIPE)
    store, until_s = EpisodeStore(folder / "episodes"), time.monotonic() + 120.0
    while not (7 in store and (folder / CHECKPOINT).exists()) and time.monotonic() < until_s:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)  # at once on a machine of its own; the tests beside it have theirs
    assert process.returncode == -signal.SIGINT
    assert all(len(store[number]) > 0 for number in range(8))
    load_student(folder / CHECKPOINT)


def test_a_checkpoint_of_a_few_bytes_makes_no_room_for_weights_that_it_has_not(tmp_path):
    np.savez_compressed(tmp_path / CHECKPOINT, **{"weights/proprio_mean": np.zeros(2_000_000, np.float32)})
    forget_peak_memory()
    before_mb = peak_memory_mb() or 0.0
    with pytest.raises(MachineError, match=re.escape(CHECKPOINT)):
        load_student(tmp_path / CHECKPOINT)
    assert (peak_memory_mb() or 0.0) - before_mb < 100.0


def test_a_folder_of_other_settings_and_a_damaged_one_are_refused(tmp_path, undisturbed):
    with pytest.raises(SettingsError) as refused:
        trained(undisturbed[0], DaggerSettings(seed=1))
    assert refused.value.cure
    (tmp_path / CHECKPOINT).write_bytes(undisturbed[1][: len(undisturbed[1]) // 2])
    with pytest.raises(MachineError):
        load_student(tmp_path / CHECKPOINT)
    with pytest.raises(MachineError):
        trained(tmp_path)


def test_beta_falls_from_the_teacher_alone_to_the_student_alone():
    settings = DaggerSettings(iterations=4, teacher_share=0.6, mixed_iterations=2)
    assert [settings.beta(iteration) for iteration in range(5)] == [1.0, 0.6, 0.3, 0.0, 0.0]


@pytest.mark.parametrize("read", [load_student, load_settings])
def test_a_folder_without_a_training_is_not_called_damaged(tmp_path, read):
    with pytest.raises(MachineError) as told:
        read(tmp_path / CHECKPOINT)
    assert told.value.where == str(tmp_path) and "`r2sego policy train`" in told.value.cure
