"""Checkpoints: all that a training goes on from, in one file that is there whole or not at all."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from ...core.arrays import Arrays, opened_arrays, save_arrays
from ...core.atomic_files import made_whole
from ...core.errors import MachineError, SettingsError
from ...core.json_files import parse_json
from ..student.network import Student
from .settings import DaggerSettings

_DAMAGED = "the checkpoint is damaged"
_CURE = "Remove the folder and train again."
_MOMENTS = ("step", "exp_avg", "exp_avg_sq")


@dataclass(frozen=True)
class Place:
    """Where a training is: ``eye_epochs`` passes of the eye and ``epochs`` after ``iteration`` are made.

    ``updates`` are those of all passes.
    """

    eye_epochs: int = 0
    iteration: int = 0
    epochs: int = 0
    updates: int = 0


def save_checkpoint(
    file: Path, student: Student, optimizer: torch.optim.Adam, place: Place, settings: DaggerSettings
) -> None:
    """Write ``file`` whole."""
    arrays = {f"weights/{name}": tensor.numpy() for name, tensor in student.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        arrays |= {f"adam/{index}/{name}": moments[name].numpy() for name in _MOMENTS}
    said = json.dumps({**dataclasses.asdict(place), "settings": dataclasses.asdict(settings)})
    with made_whole(file) as unfinished:
        save_arrays(unfinished, said=np.array(said), **arrays)


def load_checkpoint(file: Path, student: Student, optimizer: torch.optim.Adam, settings: DaggerSettings) -> Place:
    """Set ``student`` and ``optimizer`` to what ``save_checkpoint`` wrote.

    Raises MachineError where the file is damaged, and SettingsError where it is of other settings.
    """
    with opened_arrays(file, MachineError, _DAMAGED, _CURE) as arrays:
        said = parse_json(str(arrays["said"]))
        same = said["settings"] == dataclasses.asdict(settings)
        place = Place(*(int(said[field.name]) for field in dataclasses.fields(Place)))
        if same and not (place.iteration <= settings.iterations and min(dataclasses.astuple(place)) >= 0):
            raise ValueError(f"{place} is none of the settings'")
        student.load_state_dict({name: _like(arrays, f"weights/{name}", t) for name, t in student.state_dict().items()})
        state = optimizer.state_dict()
        state["state"] = {
            index: {
                name: _like(arrays, f"adam/{index}/{name}", torch.zeros(()) if name == "step" else weights)
                for name in _MOMENTS
            }
            for index, weights in enumerate(student.parameters())
            if f"adam/{index}/step" in arrays  # what has not learnt yet has none
        }
        optimizer.load_state_dict(state)
    if not same:
        raise SettingsError(
            "a training with other settings was begun here", where=file, cure="Give its settings, or another folder."
        )
    return place


def load_student(file: Path) -> Student:
    """The student of a checkpoint. Raises MachineError where it is damaged, or not there."""
    _require(file)
    with opened_arrays(file, MachineError, _DAMAGED, _CURE) as arrays:
        size = len(arrays["weights/proprio_mean"])
        if arrays["weights/body.0.weight"].shape[1:] != (size,):  # else a small file makes room for any size
            raise ValueError(f"there are no weights of {size} numbers")
        student = Student(size)
        student.load_state_dict({name: _like(arrays, f"weights/{name}", t) for name, t in student.state_dict().items()})
    return student.eval()


def load_settings(file: Path) -> DaggerSettings:
    """The settings of a checkpoint's training. Raises MachineError where it is damaged, or not there."""
    _require(file)
    with opened_arrays(file, MachineError, _DAMAGED, _CURE) as arrays:
        return DaggerSettings(**parse_json(str(arrays["said"]))["settings"])


def _require(file: Path) -> None:
    if not file.is_file():
        raise MachineError(
            "here is no training of a policy", where=file.parent, cure="Give the folder of `r2sego policy train`."
        )


def _like(arrays: Arrays, name: str, tensor: torch.Tensor) -> torch.Tensor:
    """The array ``name``. Raises ValueError where it is not as ``tensor`` is, or not finite."""
    array = arrays[name]
    if array.shape != tuple(tensor.shape) or array.dtype != np.float32 or not np.isfinite(array).all():
        raise ValueError(f"{name} has the shape {array.shape}")
    return torch.from_numpy(array)
