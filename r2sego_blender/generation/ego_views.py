"""EgoVideoReg of Algorithm 1: the target views generated, registered and kept on disk."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from ..bundle.artifacts import Artifact
from ..captures.capture import Capture
from ..config.settings import Settings
from ..core.cameras import Camera
from ..core.errors import CaptureError, GenerationError, NativeError
from ..core.images import load_image, save_image, to_uint8
from ..core.json_files import read_json, write_json
from ..core.progress import SILENT, Progress
from ..views.photographs import places
from ..views.selection import Selection
from .conditions.condition_files import save_conditions
from .conditions.conditions import Condition, Renderer
from .conditions.point_condition import PointConditions
from .decisions import is_accepted
from .generators.slot import Frame, Generator
from .paths.detours import ClearSpace
from .paths.paths import camera_path, reference_from_frame
from .registration.frame_registration import RegisteredFrame, hopeless, register_frame
from .registration.landmarks import Landmarks
from .registration.pnp import PnPRegistrar
from .registration.slot import Registrar

_CLIP_FRAME_MS = 80
_CLIP_LAST_MS = 1200  # the kept frame rests before the clip starts again
_CLIP_QUALITY = 80
_EMBEDDED: Registrar = PnPRegistrar()


@dataclass(frozen=True)
class PseudoObservation:
    """A generated frame with its estimated camera: one element of D_ego (Eq. 3).

    ``image`` (H, W, 3) and ``confidence`` (H, W) are float32 in [0, 1]; ``camera`` is the
    registered one, not the query; ``rank`` is the target's rank in the selection and
    ``reference`` the index of its capture i(v).
    """

    image: np.ndarray
    camera: Camera
    confidence: np.ndarray
    rank: int
    reference: int


def ego_video_reg(
    selection: Selection,
    candidates: Sequence[Camera],
    captures: Sequence[Capture],
    renderer: Renderer,
    generator: Generator,
    landmarks: Landmarks,
    settings: Settings,
    folder: Path,
    progress: Progress = SILENT,
    space: ClearSpace | None = None,
    colours: PointConditions | None = None,
    registrar: Registrar = _EMBEDDED,
) -> tuple[PseudoObservation, ...]:
    """Generate and register the selection's target views; write each as ``folder/<rank>/``.

    ``candidates`` are the M cameras the selection was made from; it has references for the
    targets and as many more as may replace them. Paths go around what ``space`` has in their
    way; with ``colours`` the captures' colours stay beside the conditions; ``registrar`` says
    where frames are first looked for. A frame that cannot be generated or registered is
    rejected, with its reason in ``pose.json``, and the next-ranked survivor takes its place, at
    most ``generation.max_replacements`` times; one of which it is clear beforehand is not
    generated, only its last condition rendered.
    Returns the accepted ones in rank order, as ``load_pseudo_observations`` reads them.
    """
    wanted = len(selection.targets)
    ranked = selection.ranked[: wanted + settings.generation.max_replacements]
    cameras = [capture.camera for capture in captures]
    accepted = 0
    with progress.task("Generating ego views", wanted) as task:
        for rank, candidate in enumerate(ranked):
            if accepted == wanted:
                break
            target = candidates[candidate]
            reference = int(selection.reference[candidate])
            view = _View(
                rank,
                int(candidate),
                int(selection.rollout[candidate]),
                int(selection.frame[candidate]),
                reference,
                captures[reference].name,
                float(selection.overlaps[candidate, reference]),
            )
            reason = _generate(
                view,
                target,
                cameras[reference],
                renderer,
                generator,
                landmarks,
                settings,
                folder / f"{rank:03d}",
                space,
                colours,
                registrar,
            )
            if reason is None:
                accepted += 1
                task.advance()
                kept = folder / f"{rank:03d}" / "frame.png"
                progress.picture("Generated view", functools.partial(load_image, kept))
            else:
                progress.message(f"target view of rank {rank + 1}, {reason}")
    if accepted < wanted:
        lacking = f"; photographs that would show more: {places(selection.photographs)}" * bool(selection.photographs)
        progress.message(
            f"{accepted} of {wanted} target views could be generated and registered, no other is left to try{lacking}",
            level="warning",
        )
    return load_pseudo_observations(folder)


def load_pseudo_observations(folder: Path) -> tuple[PseudoObservation, ...]:
    """The accepted views under ``folder``, in rank order; what a person decided goes first.

    Raises GenerationError when a view's files are damaged.
    """
    observations = []
    for view in sorted(folder.glob("*/pose.json")):
        with _damage_of(view.parent):
            record = read_json(view)
            if is_accepted(view.parent, record["accepted"]):
                if record["estimate"] is None:
                    raise ValueError("it was accepted by hand, but has no estimated pose")
                observations.append(_observation(view.parent, record))
    return tuple(observations)


def check_views(folder: Path) -> None:
    """Raises GenerationError when a generated view is damaged, accepted or not; decisions are not read."""
    for view in sorted(place for place in folder.iterdir() if place.is_dir()):
        with _damage_of(view):
            record = read_json(view / "pose.json")
            if record["estimate"] is not None:
                _observation(view, record)


@contextlib.contextmanager
def _damage_of(view: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, KeyError, TypeError, ValueError, CaptureError) as error:
        raise GenerationError(
            f"this generated view cannot be used: {error}",
            where=view,
            cure="Run `r2sego refine` again, or delete its decision.json.",
        ) from error


def _observation(view: Path, record: Mapping[str, Any]) -> PseudoObservation:
    image = load_image(view / "frame.png")
    confidence = load_image(view / "confidence.png")[..., 0]
    camera = Camera.from_json(record["estimate"])
    if image.shape[:2] != camera.shape or confidence.shape != camera.shape:
        raise ValueError("the images are not of the camera's size")
    rank, reference = int(record["rank"]), int(record["reference"])
    if min(rank, reference) < 0:
        raise ValueError("it has no rank, or no reference")
    return PseudoObservation(image, camera, confidence, rank, reference)


@dataclass(frozen=True)
class _View:
    """What a view is made from, as ``pose.json`` tells it."""

    rank: int
    candidate: int
    rollout: int
    frame: int
    reference: int
    reference_name: str
    overlap: float


def _generate(
    view: _View,
    target: Camera,
    reference: Camera,
    renderer: Renderer,
    generator: Generator,
    landmarks: Landmarks,
    settings: Settings,
    folder: Path,
    space: ClearSpace | None,
    colours: PointConditions | None,
    registrar: Registrar,
) -> str | None:
    """Make and write one view; None when it is accepted, else the reason why not."""
    folder.mkdir(parents=True, exist_ok=True)
    way = None if space is None else space.way(reference.centre, target.centre)
    path = camera_path(reference, target, settings.generation.clip_frames, way.points if way else None)
    path = (*(camera.scaled(settings.generation.clip_scale) for camera in path[:-1]), path[-1])
    _write_path(folder / "path.json", view, reference, path, way.note if way else "")
    why = hopeless(target, reference, landmarks, settings.registration)
    conditions = renderer.render(path[-1:] if why else path)
    kept = conditions if settings.generation.kept_conditions == "clip" else conditions[-1:]
    points = () if colours is None else colours.render(view.reference, kept)
    save_conditions(folder / "conditions", kept, points)
    if why:
        return _give_up(folder, view, generator.name, target, f"not generated, {why}")
    try:
        clip = generator.generate(view.reference, conditions)
        _check_clip(clip, conditions, generator.name)
    except GenerationError as error:
        return _give_up(folder, view, generator.name, target, str(error))
    _write_clip(folder, clip)
    image = load_image(folder / "frame.png")  # registered as it will be read for training
    try:
        start = registrar.start(image, target, view.reference, landmarks)
    except (GenerationError, NativeError) as error:
        return _give_up(folder, view, generator.name, target, f"not registered, {error}", {"registrar": registrar.name})
    registered = register_frame(image, target, reference, landmarks, settings.registration, settings.seed, start)
    reason, told = registered.reason, dict[str, Any]()
    if start is not None:  # the embedded registrar's views stay as they were before there was another
        reason += f" (looked for about the pose of {registrar.name})"
        told = {"registrar": registrar.name, "start": start.to_json()}
    _write_pose(folder / "pose.json", view, generator.name, target, registered, reason, told)
    return None if registered.camera is not None else reason


def _give_up(
    folder: Path, view: _View, generator: str, query: Camera, why: str, told: Mapping[str, Any] | None = None
) -> str:
    """Write a view without a frame; its reason."""
    reason = f"rejected: {why}"
    _write_pose(folder / "pose.json", view, generator, query, None, reason, told or {})
    return reason


def _check_clip(clip: Sequence[Frame], conditions: Sequence[Condition], generator: str) -> None:
    shapes = [frame.image.shape for frame in clip]
    if shapes != [(*condition.camera.shape, 3) for condition in conditions]:
        raise GenerationError(
            f"{generator} returned {len(clip)} frames that do not fit the {len(conditions)} conditions",
            cure="Check the generator.",
        )
    if not all(np.isfinite(frame.image).all() for frame in clip):
        raise GenerationError(f"{generator} returned pixels that are no numbers", cure="Check the generator.")


def _write_path(file: Path, view: _View, reference: Camera, path: Sequence[Camera], note: str) -> None:
    record = {
        "reference": view.reference,
        "reference_name": view.reference_name,
        "note": note,
        "cameras": [camera.to_json() for camera in path],
        "reference_from_frame": reference_from_frame(reference, path).tolist(),
    }
    write_json(file, record)


def _write_clip(folder: Path, clip: Sequence[Frame]) -> None:
    """``frame.png`` and ``confidence.png`` of the kept frame; ``clip/*.png`` and ``clip.webp``."""
    (folder / "clip").mkdir(exist_ok=True)
    for index, frame in enumerate(clip):
        save_image(folder / "clip" / f"{index:03d}.png", frame.image)
    save_image(folder / "frame.png", clip[-1].image)
    save_image(folder / "confidence.png", clip[-1].confidence)
    height, width = clip[0].image.shape[:2]
    images = [to_uint8(frame.image) for frame in clip]
    shown = [Image.fromarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)) for image in images]
    shown[0].save(
        folder / "clip.webp",
        save_all=True,
        append_images=shown[1:],
        loop=0,
        quality=_CLIP_QUALITY,
        method=0,
        duration=[_CLIP_FRAME_MS] * (len(shown) - 1) + [_CLIP_LAST_MS],
    )


def _write_pose(
    file: Path,
    view: _View,
    generator: str,
    query: Camera,
    registered: RegisteredFrame | None,
    reason: str,
    told: Mapping[str, Any],
) -> None:
    """``told`` is what the registrar is called and said beforehand, nothing of the embedded one."""
    accepted = registered is not None and registered.camera is not None
    record = {
        "accepted": accepted,
        "reason": reason,
        "generator": generator,
        **vars(view),
        "query": query.to_json(),
        "estimate": None,
        **told,
    }
    if registered is not None:
        record |= {
            "expected": registered.expected,
            "matches": registered.matches,
            "inliers": registered.inliers,
            "spread": registered.spread,
        }
    if registered is not None and registered.estimate is not None:
        record |= {
            "estimate": registered.estimate.to_json(),
            "offset_m": registered.offset_m,
            "turn_deg": registered.turn_deg,
            "focal_px": registered.focal_px,
            "sigma_m": registered.sigma_m,
            "sigma_deg": registered.sigma_deg,
        }
    write_json(file, record)


VIEWS = Artifact("views", load_pseudo_observations, check=check_views)
"""A round's target views, generated, registered and decided on: ``VIEWS.of_round(l)``."""
