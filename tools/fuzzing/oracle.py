"""Whether what a reader gave is what a program may go on with."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from r2sego_blender.core.cameras import Camera, is_rigid

_FARTHEST_M = 1e18
_SMALLEST_INTEGER, _BEYOND_INTEGERS = -(1 << 63), 1 << 64
_UNIT = 1e-3
_DEEPEST = 12


def fault_of(value: Any, at: str = "", deep: int = 0) -> str:
    """What is wrong with a value, or with one somewhere in it; "" for nothing.

    Numbers are finite and fit 64 bits, poses rigid, lenses have a focal length, faces vertices.
    """
    if isinstance(value, float | np.floating):
        return "" if math.isfinite(value) else f"{at} is not finite"
    if isinstance(value, int):
        return "" if _SMALLEST_INTEGER <= value < _BEYOND_INTEGERS else f"{at} has more than 64 bits"
    if isinstance(value, np.ndarray):
        return _fault_of_array(value, at)
    if isinstance(value, Camera):
        return _fault_of_camera(value, at)
    if deep > _DEEPEST:
        return ""
    parts: Mapping[Any, Any] = {}
    if type(value).__name__ == "SparsePoints":  # where a capture did not measure a point it says so by NaN
        value = dataclasses.replace(value, pixels=value.pixels[value.visibility])
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    elif isinstance(value, Mapping):
        parts = value
    elif isinstance(value, list | tuple):
        parts = dict(enumerate(value))
    for name, one in parts.items():
        if fault := fault_of(one, f"{at}.{name}" if isinstance(name, str) else at, deep + 1):
            return fault
    special = _OF_KINDS.get(type(value).__name__)
    fault = special(value) if special else ""
    return fault and f"{at}: {fault}"


def _fault_of_array(array: np.ndarray, at: str) -> str:
    if array.dtype.kind not in "biufUS":
        return f"{at} holds {array.dtype}"
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        return f"{at} is not finite"
    name = at.rpartition(".")[2]
    if name in ("camera_poses", "poses", "world_from_camera", "world_from_body"):
        matrices = array.reshape(-1, 4, 4).copy()
        matrices[:, :3, 3] = 0.0  # finite places may lie anywhere
        if not is_rigid(matrices):
            return f"{at} is not rigid"
    return ""


def _fault_of_camera(camera: Camera, at: str) -> str:
    lens = (camera.fx, camera.fy, camera.cx, camera.cy)
    if not all(map(math.isfinite, lens)) or min(lens[:2]) <= 0:
        return f"{at} has no focal length"
    if min(camera.width, camera.height) < 1:
        return f"{at} has no size"
    return "" if is_rigid(camera.world_from_camera) else f"{at} is not rigid"


def _splats(asset: Any) -> str:
    with np.errstate(all="ignore"):
        if np.abs(asset.means).max(initial=0.0) > _FARTHEST_M:
            return "a mean beyond 1e18 m"
        if not np.isfinite(np.exp(asset.log_scales.astype(np.float32))).all():
            return "a scale overflows"
        if not np.isfinite((asset.quaternions.astype(np.float32) ** 2).sum(axis=1)).all():
            return "a quaternion's norm overflows"
    return ""


def _mesh(mesh: Any) -> str:
    faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices)
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] != 3:
        return f"faces are {faces.dtype} {faces.shape}"
    if vertices.dtype.kind not in "fiub" or vertices.ndim != 2 or vertices.shape[1] != 3:
        return f"vertices are {vertices.dtype} {vertices.shape}"
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        return "a face has no vertices"
    return ""


def _depth(depths: Any) -> str:
    return "negative depth" if np.asarray(depths.depth).min(initial=0) < 0 else ""


def _unit(values: np.ndarray) -> bool:
    return bool((np.abs(np.linalg.norm(values.astype(np.float64), axis=-1) - 1.0) < _UNIT).all())


def _planes(planes: Any) -> str:
    return "" if _unit(planes.normals) else "a plane's normal is not of length 1"


def _rollout(rollout: Any) -> str:
    if rollout.qpos.ndim != 2 or rollout.qpos.shape[1] < 7:
        return f"qpos is {rollout.qpos.shape}"
    return "" if _unit(rollout.qpos[:, 3:7]) else "a base's quaternion is not of length 1"


def _recording(recording: Any) -> str:
    if recording.quaternion is not None and not _unit(recording.quaternion):
        return "a quaternion is not of length 1"
    return "" if recording.rate_hz > 0 else "no rate"


def _human(recording: Any) -> str:
    turns = recording.rotation.reshape(-1, 3, 3)
    error = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(initial=0.0)
    return "" if error < _UNIT else "a turn is no rotation"


def _similarity(matrix: np.ndarray) -> str:
    linear = np.asarray(matrix, np.float64)[:3, :3]
    with np.errstate(all="ignore"):
        scale = np.cbrt(np.linalg.det(linear))
        even = np.abs(linear @ linear.T - scale**2 * np.eye(3)).max() <= 1e-3 * scale**2
    return "" if np.isfinite(scale) and scale > 0 and even else "no similarity"


def _lens(lens: Any) -> str:
    return "" if min(lens.fx, lens.fy) > 0 and min(lens.width, lens.height) > 0 else "no focal length"


_OF_KINDS: Mapping[str, Callable[[Any], str]] = {
    "SplatAsset": _splats,
    "ShownSplats": lambda splats: "" if np.isfinite(splats.means).all() else "not finite",
    "GeometryProxy": _mesh,
    "AlignedPrior": _mesh,
    "Shape": _mesh,
    "Drawn": _mesh,
    "DepthMap": _depth,
    "CompletedDepth": _depth,
    "SensorMap": _depth,
    "RoomPlanes": _planes,
    "Rollout": _rollout,
    "RobotRecording": _recording,
    "HumanRecording": _human,
    "Declaration": lambda declared: _similarity(np.array(declared.world_from_capture)),
    "Placement": lambda placement: _similarity(placement.world_from_own),
    "Photograph": lambda one: "" if is_rigid(one.world_from_camera) else "a pose is not rigid",
    "Lens": _lens,
}
"""By the name of a class, what else has to hold."""
