"""What a training of a policy leaves, episodes, checkpoints and kept evaluations, and the light it is tested in."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from ..harness import Harness

_STEPS, _PROPRIO = 3, 8


def _episode(folder: Path) -> None:
    from r2sego_blender.policy.dagger.episodes import Episode, EpisodeStore, Outcome
    from r2sego_blender.policy.student.targets import PICTURE_SHAPE, POSE_SIZE, SEAT_TARGETS

    sizes = _PROPRIO, 4, SEAT_TARGETS, POSE_SIZE
    parts = (np.linspace(-1.0, 1.0, _STEPS * size).reshape(_STEPS, size) for size in sizes)
    proprio, actions, seat, base_poses = (part.astype(np.float32) for part in parts)
    pictures = np.full((_STEPS, *PICTURE_SHAPE), 90, np.uint8)
    EpisodeStore(folder).add(0, Episode(pictures, proprio, actions, seat, base_poses, Outcome(7, "fall", _STEPS, 12.0)))


def _read_episode(folder: Path) -> Any:
    from r2sego_blender.policy.dagger.episodes import EpisodeStore

    episode = EpisodeStore(folder)[0]
    return dataclasses.replace(episode, seat=np.nan_to_num(episode.seat))  # nan is where there is no seat


def _checkpoint(folder: Path) -> None:
    import torch

    from r2sego_blender.policy.dagger.checkpoints import Place, save_checkpoint
    from r2sego_blender.policy.dagger.settings import DaggerSettings
    from r2sego_blender.policy.student.network import Student

    with torch.random.fork_rng(devices=()):
        torch.manual_seed(0)
        student = Student(_PROPRIO)
    save_checkpoint(
        folder / "checkpoint.npz", student, torch.optim.Adam(student.parameters()), Place(), DaggerSettings()
    )


def _read_checkpoint(folder: Path) -> Any:
    import torch

    from r2sego_blender.policy.dagger.checkpoints import load_checkpoint
    from r2sego_blender.policy.dagger.settings import DaggerSettings
    from r2sego_blender.policy.student.network import Student

    student = Student(_PROPRIO)
    place = load_checkpoint(
        folder / "checkpoint.npz", student, torch.optim.Adam(student.parameters()), DaggerSettings()
    )
    return place, {name: tensor.numpy() for name, tensor in student.state_dict().items()}


def _evaluation(folder: Path) -> None:
    from r2sego_blender.results.policy_evaluation import PolicyEvaluation

    failures = {"fall": 2, "missed_target": 1}
    PolicyEvaluation("teacher", "a drive", "a.ply", "", ("stool",), 7, 10, 0.35, 0.93, failures, 14.5).save(folder)


def _read_evaluation(folder: Path) -> Any:
    from r2sego_blender.results.policy_evaluation import PolicyEvaluation

    read = PolicyEvaluation.load(folder)
    return read, read.by_end, read.policy_name


def _light_field(folder: Path) -> None:
    from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField

    vertices = np.array([[-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]], np.float32)
    faces, texels = (np.array(rows, np.int32) for rows in ([[0, 1, 2], [0, 2, 3]], [[3, 2], [2, 2]]))
    light = np.linspace(-1.0, 2.0, 10 * 4 * 3, dtype=np.float32).reshape(10, 4, 3)
    SurfaceLightField(vertices, faces, texels, light, np.zeros(3, np.float32)).save(folder / "light.npz")


def _read_light_field(folder: Path) -> Any:
    from r2sego_blender.core.cameras import Camera
    from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField

    field = SurfaceLightField.load(folder / "light.npz")
    return field, field.render(Camera(8, 6, 6.0, 6.0, 4.0, 3.0, np.eye(4)))


HARNESSES = (
    Harness("training/light", _light_field, "light.npz", "npz", _read_light_field),
    Harness("training/evaluation.json", _evaluation, "evaluation.json", "json", _read_evaluation),
    Harness("training/episode", _episode, "000000/steps.npz", "npz", _read_episode),
    Harness("training/pictures", _episode, "000000/pictures.raw", "bytes", _read_episode, share=0.2),
    Harness("training/checkpoint", _checkpoint, "checkpoint.npz", "npz", _read_checkpoint, share=0.05),
)
