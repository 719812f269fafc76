"""The robot's shapes and their poses along rollouts, as the engine wrote them. No bpy."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.artifacts import Artifact
from ...core.arrays import Arrays, opened_arrays, require_finite, require_shapes
from ...core.cameras import Camera
from ...core.digests import content_digest
from ...core.errors import SceneError
from ...core.json_files import read_json
from ...robot.rollouts.rollout import require_rigid
from .bundle import Bundle
from .rollout_list import bodies_folder, rollouts_folder

_CURE = "Show the rollout again: the engine writes them anew."


@dataclass(frozen=True)
class RobotBodies:
    """The bodies along the rollouts of a round or a trial.

    ``names`` are the bodies', ``shapes`` their vertices (V, 3) float32 metres in the body's
    frame, faces (F, 3) int32 and colours of faces (F, 3) float32 sRGB; ``camera`` is the head
    camera's lens at the identity, ``rate_hz`` the frames a second, ``digest`` the rollouts'.
    """

    folder: Path
    names: tuple[str, ...]
    shapes: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    camera: Camera
    rate_hz: float
    digest: str

    @staticmethod
    def load(bundle: Bundle, round_index: int) -> RobotBodies:
        """Read them. Raises SceneError when they are not there, damaged, or of other rollouts."""
        folder = bodies_folder(bundle, round_index)
        if not are_written(bundle, round_index):
            raise SceneError("the robot's bodies along these rollouts are missing", where=folder, cure=_CURE)
        try:
            told = _description(folder)
            with opened_arrays(folder / "shapes.npz", SceneError, "it cannot be read", _CURE) as arrays:
                shapes = tuple(_shape(arrays, index) for index in range(len(told["bodies"])))
            camera = Camera.from_json({**told["camera"], "world_from_camera": np.eye(4)})
            rate_hz = float(told["camera_rate_hz"])
            if not rate_hz > 0.0:
                raise ValueError(f"the camera's rate is {rate_hz}")
            return RobotBodies(folder, tuple(map(str, told["bodies"])), shapes, camera, rate_hz, told["rollouts"])
        except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            raise SceneError(f"it is damaged: {error!r}", where=folder / "bodies.json", cure=_CURE) from error

    def poses(self, number: int) -> np.ndarray:
        """``world_from_body`` (T, B, 4, 4) float64 along an attempt. Raises SceneError: damaged."""
        with opened_arrays(self.folder / "poses.npz", SceneError, "it cannot be read", _CURE) as arrays:
            poses = arrays[f"world_from_body_{number:04d}"]
            if poses.ndim != 4 or poses.shape[1:] != (len(self.names), 4, 4):
                raise SceneError("the poses are not these bodies'", where=self.folder / "poses.npz", cure=_CURE)
            require_finite(poses=poses)
            require_rigid(poses=poses)
        return poses


def are_written(bundle: Bundle, round_index: int) -> bool:
    """Whether the bodies are there and belong to the rollouts that are there now."""
    try:
        told = _description(bodies_folder(bundle, round_index))
    except (OSError, ValueError):
        return False
    return bool(told.get("rollouts", "") == digest_of(bundle, round_index) != "")


def digest_of(bundle: Bundle, round_index: int) -> str:
    """The digest of the rollouts that are there now; '' for none."""
    file = rollouts_folder(bundle, round_index) / "rollouts.npz"
    if not file.is_file():
        return ""
    state = file.stat()
    return _digest(file, state.st_mtime_ns, state.st_size)


def _description(folder: Path) -> Mapping[str, Any]:
    told = read_json(folder / "bodies.json")
    if not isinstance(told, dict):
        raise ValueError("it is no description of bodies")
    return told


def _shape(arrays: Arrays, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces and colours of a body. Raises ValueError where they are none."""
    parts = {name: arrays[f"{name}_{index:04d}"] for name in ("vertices", "faces", "colours")}
    require_shapes(parts, vertices="V 3", faces="F 3", colours="F 3")
    require_finite(vertices=parts["vertices"], colours=parts["colours"])
    faces = parts["faces"]
    if faces.dtype.kind not in "iu" or (faces.size and not 0 <= faces.min() <= faces.max() < len(parts["vertices"])):
        raise ValueError(f"faces of body {index} name no vertices")
    return parts["vertices"], faces, parts["colours"]


@functools.lru_cache(maxsize=16)
def _digest(file: Path, _changed_ns: int, _size: int) -> str:
    """The content's digest, computed once for a file that has not changed."""
    return content_digest(file)


BODIES = Artifact("bodies", load=lambda folder: folder, editable=False)
"""The robot's shapes and their poses along a round's rollouts; ``RobotBodies`` reads them."""
