"""One policy of a pair, trained and tested in a bundle's own room, and what it leaves for other programs."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="the extra `policy` is not installed")
pytest.importorskip("tensorboardX", reason="the extra `policy` is not installed")
pytest.importorskip("onnxscript", reason="the extra `policy` is not installed")
pytest.importorskip("av", reason="the extra `policy` is not installed")

from training_room import training_room

from r2sego_blender.policy.dagger.episodes import EpisodeStore
from r2sego_blender.policy.dagger.settings import DaggerSettings
from r2sego_blender.policy.exporting import DEMONSTRATIONS, export_training
from r2sego_blender.policy.paired.policies import OUTCOMES, STUDENT, as_json, train_and_test
from r2sego_blender.policy.training import STUDENT_ONNX, Task, evaluation_seeds


def test_a_policy_is_trained_and_its_episodes_are_those_of_its_seed(tmp_path: Path):
    task = as_json(Task(training_room(tmp_path / "room.r2s")))
    settings = DaggerSettings(seed=5, teacher_episodes=1, views=4, eye_epochs=1, iterations=0, epochs=1)
    place = tmp_path / "seed_0" / "refined"
    train_and_test(
        {
            "place": str(place),
            "task": task,
            "tests": {"training": task},
            "settings": dataclasses.asdict(settings),
            "episodes": 1,
        }
    )
    assert (place / STUDENT / STUDENT_ONNX).is_file()
    ((seed, _, steps, assist_n),) = json.loads((place / OUTCOMES).read_text())["training"]
    assert [seed] == evaluation_seeds(5, 1)
    assert steps > 0
    assert assist_n >= 0.0

    exported = tmp_path / "exported"
    export_training(place / STUDENT, exported)
    assert (exported / STUDENT_ONNX).read_bytes() == (place / STUDENT / STUDENT_ONNX).read_bytes()
    info = json.loads((exported / DEMONSTRATIONS / "meta" / "info.json").read_text())
    taught = EpisodeStore(place / STUDENT / "episodes")[0]
    assert info["total_frames"] == len(taught)
    assert info["features"]["action"]["names"] == ["vx", "vy", "yaw_rate", "sit"]
