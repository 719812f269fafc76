"""How well frames are registered on a scene with ground truth, by each registrar of the slot, on the same frames.

Photographs of the frozen views are frames of a perfect generator; generated ones have its flaws. The pipeline's own
depth of the captures is what frames are registered to; true poses and depths score, and are what a recorded VGGT
answers with, after it has drifted.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, rotation_angle_rad
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.evaluation.ground_truth import load_ground_truth
from r2sego_blender.generation.registration.frame_registration import RegisteredFrame, register_frame
from r2sego_blender.generation.registration.landmarks import Landmarks
from r2sego_blender.generation.registration.vggt import VGGTRegistrar
from r2sego_blender.geometry.room.completed_depth import COMPLETED
from r2sego_blender.geometry.stereo.stereo import DEPTH
from r2sego_blender.refine.depths import completed_depths, reliable_depths
from r2sego_blender.views.references import select_reference
from r2sego_blender.workers.protocol.recorded_worker import RecordedWorker

from .generation import Arm, bundle_with_proxy, estimated_arm
from .truth.disturbance import disturbed_pose
from .truth.drifting_vggt import DRIFT_DEG, DRIFT_M, record_drifting

_QUANTILE = 0.9
_WRONG = "wrong"
_KINDS = {
    "photographs": "photographs, query 5 cm and 3 degrees off",
    "generated": "generated at the query",
    "drifted": "generated 5 cm and 3 degrees off the query",
    _WRONG: "another place, mirrored, shifted, a capture, noise",
}
_REGISTRARS = {"pnp": "embedded", "vggt": "VGGT's role, drifting"}


@dataclass(frozen=True)
class _Frame:
    """A frame (H, W, 3) float32 made for ``query`` from the capture ``reference``, and where it truly is.

    One of something else is nowhere; VGGT takes it to be at its query.
    """

    image: np.ndarray
    query: Camera
    truth: Camera
    reference: int


def bench_registration(
    scene: Path, bundle: Path | None = None, seed: int = 0, progress: Progress = SILENT
) -> dict[str, Any]:
    """Register photographs, generated frames and wrong ones at the frozen poses of the folder ``scene``.

    ``scene`` and ``bundle`` are those of ``bench_generation``. Returns JSON-ready figures: of each registrar and
    kind of frame how many are accepted, the error at the 90th percentile of these, and seconds a frame. Raises as
    ``bench_generation`` does.
    """
    truth = load_ground_truth(scene)
    with tempfile.TemporaryDirectory(prefix="r2sego-registration-") as temporary:
        folder = Path(temporary)
        made = bundle_with_proxy(scene, bundle, folder / "scene.r2s", seed, progress)
        views = frozen_views(made, scene / "cameras.json").views
        depths = [one.depth for one in truth.transformed(np.array(made.declaration.world_from_capture)).views]
        arm = estimated_arm(made)
        completed = completed_depths(arm.captures, made.read(COMPLETED))
        observed = reliable_depths(arm.captures, made.read(DEPTH), arm.settings.stereo)
        landmarks = Landmarks.build(arm.captures, observed, completed, progress)
        frames = _frames(arm, views, np.random.default_rng([seed, 0]))
        figures: dict[str, Any] = {"machine": processor(), "scene": str(scene), "frozen": len(views), "seed": seed}
        for name in _REGISTRARS:
            rng = np.random.default_rng([seed, 1])
            figures[name] = {}
            for kind, of_kind in frames.items():
                figures[name][kind] = _scored(name, of_kind, arm, depths, landmarks, rng, folder / f"{name}_{kind}")
    return figures


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    text = [f"{figures['machine']}", f"{figures['scene']}: accepted, then cm and degrees at the 90th percentile", ""]
    text.append(f"{'':<48}" + "".join(f"{title:>34}" for title in _REGISTRARS.values()))
    for kind, title in _KINDS.items():
        told = []
        for one in (figures[name][kind] for name in _REGISTRARS):
            error = "" if one["cm"] is None or kind == _WRONG else f", {one['cm']:.2f}, {one['degrees']:.2f}"
            told.append(f"{one['accepted']}/{one['frames']}{error}, {one['seconds']:.1f} s")
        text.append(f"{title:<48}" + "".join(f"{one:>34}" for one in told))
    return text


def _frames(arm: Arm, views: Sequence[Capture], rng: np.random.Generator) -> dict[str, list[_Frame]]:
    """The frames of each kind, the same for every registrar."""
    found: dict[str, list[_Frame]] = {kind: [] for kind in _KINDS}
    cameras = [capture.camera for capture in arm.captures]
    for index, view in enumerate(views):
        camera, image = view.camera, view.image()
        reference, _ = select_reference(camera, cameras, arm.renderer.depth, arm.depths, arm.settings.selection)
        off, drifted = (camera.at(disturbed_pose(camera.world_from_camera, rng, DRIFT_M, DRIFT_DEG)) for _ in "ab")
        found["photographs"].append(_Frame(image, off, camera, reference))
        for kind, truth in (("generated", camera), ("drifted", drifted)):
            made = arm.generator.generate(reference, [arm.renderer.condition(truth)])[-1].image
            found[kind].append(_Frame(made, camera, truth, reference))
        wrong = (
            views[(index + 5) % len(views)].image(),
            np.ascontiguousarray(image[:, ::-1]),
            np.roll(image, image.shape[1] // 4, axis=1),
            arm.captures[reference].image(),
            rng.random(image.shape, np.float32),
        )
        found[_WRONG] += [_Frame(one, camera, camera, reference) for one in wrong if one.shape == image.shape]
    return found


def _scored(
    name: str,
    frames: Sequence[_Frame],
    arm: Arm,
    depths: Sequence[np.ndarray],
    landmarks: Landmarks,
    rng: np.random.Generator,
    folder: Path,
) -> dict[str, Any]:
    """How many frames the registrar ``name`` has accepted, how well, and how fast."""
    errors, seconds = [], 0.0
    for index, frame in enumerate(frames):
        recorded = folder / f"{index:03d}"
        if name == "vggt":
            _record(recorded, frame, arm, depths, landmarks, rng)
        began_s = time.perf_counter()
        registered = _registered(name, frame, arm, landmarks, recorded)
        seconds += time.perf_counter() - began_s
        if registered.camera is not None:
            off_m = np.linalg.norm(registered.camera.centre - frame.truth.centre)
            off_rad = rotation_angle_rad(registered.camera.world_from_camera, frame.truth.world_from_camera)
            errors.append((100.0 * float(off_m), float(np.degrees(off_rad))))
    centimetres, degrees = np.quantile(errors, _QUANTILE, axis=0).tolist() if errors else (None, None)
    return {
        "frames": len(frames),
        "accepted": len(errors),
        "cm": centimetres,
        "degrees": degrees,
        "seconds": round(seconds / max(1, len(frames)), 3),
    }


def _record(
    folder: Path, frame: _Frame, arm: Arm, depths: Sequence[np.ndarray], landmarks: Landmarks, rng: np.random.Generator
) -> None:
    fixed = arm.captures[frame.reference].camera
    seen = landmarks.indices_seen_best(frame.query, fixed, arm.settings.registration.max_captures)
    others = [arm.captures[index].camera for index in seen if index != frame.reference]
    record_drifting(folder, [fixed, frame.truth, *others], depths[frame.reference], rng)


def _registered(name: str, frame: _Frame, arm: Arm, landmarks: Landmarks, recorded: Path) -> RegisteredFrame:
    h, start = arm.settings, None
    if name == "vggt":
        registrar = VGGTRegistrar(RecordedWorker(recorded), arm.captures, h.registration.max_captures)
        start = registrar.start(frame.image, frame.query, frame.reference, landmarks)
    fixed = arm.captures[frame.reference].camera
    return register_frame(frame.image, frame.query, fixed, landmarks, h.registration, h.seed, start)
