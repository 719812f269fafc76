"""How good the embedded generator is on a scene with ground truth, and what it costs.

The pipeline makes the geometry proxy of photographs and poses alone, and the generator
blends on it. The truth comes afterwards: frozen views and true depths score, and the true
surface takes the proxy's place once, to tell the generator's own errors from the proxy's.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.stats import spearmanr

from r2sego_blender.bundle.layout import of_round
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.commands.bench_defaults import GENERATION_CLIPS
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.evaluation.error_causes import CAUSES, causes, split
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.evaluation.ground_truth import GroundTruth, load_ground_truth
from r2sego_blender.generation.conditions.conditions import Condition, ZBufferRenderer
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.generators.slot import Frame
from r2sego_blender.generation.paths.paths import camera_path
from r2sego_blender.geometry.proxy.proxy import PROXY, GeometryProxy, Provenance
from r2sego_blender.geometry.stereo.stereo import DEPTH
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.refine.depths import proxy_depths, reliable_depths
from r2sego_blender.splats.metrics import psnr, ssim
from r2sego_blender.views.references import select_reference

from .steadiness import flow_differences
from .truth.true_objects import declare_true_objects

_ESTIMATED, _WITH_PRIORS, _TRUE = "estimated", "with_priors", "true_geometry"
_LIBRARY = 2  # the stream of random numbers that bench geometry makes its library with


@dataclass(frozen=True)
class Arm:
    """One generator and the proxy it blends on, ready to answer cameras of the world frame."""

    settings: Settings
    captures: tuple[Capture, ...]
    depths: list[np.ndarray]
    renderer: ZBufferRenderer
    generator: BlendingGenerator
    made_s: float


def bench_generation(
    scene: Path,
    bundle: Path | None = None,
    library: Path | None = None,
    seed: int = 0,
    clips: int = GENERATION_CLIPS,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Score the embedded generator at the frozen poses of the folder ``scene``.

    ``scene`` is what ``load_ground_truth`` reads, with its photographs and frozen views.
    ``bundle`` is one made of its captures whose first proxy is there; it is copied and left
    as it is. Without it the proxy is made here. With ``library`` the proxy is made once more
    with shape priors, as ``bench_geometry`` does. ``clips`` whole clips tell the steadiness.
    Returns JSON-ready figures. Raises SceneError for a bundle without proxy, EvaluationError
    and CaptureError for the folder, and what the steps raise.
    """
    truth = load_ground_truth(scene)
    with tempfile.TemporaryDirectory(prefix="r2sego-generation-") as temporary:
        folder = Path(temporary)
        made = bundle_with_proxy(scene, bundle, folder / "scene.r2s", seed, progress)
        views = frozen_views(made, scene / "cameras.json").views
        in_world = truth.transformed(np.array(made.declaration.world_from_capture))
        true_arm = _true_arm(made, in_world)
        _warm_up(true_arm, views[0].camera)
        figures: dict[str, Any] = {
            "machine": processor(),
            "threads": numba.get_num_threads(),
            "scene": str(scene),
            "captures": len(truth.views),
            "frozen": len(views),
            "seed": seed,
        }
        figures[_ESTIMATED] = _scored(estimated_arm(made), views, in_world, clips)
        figures[_TRUE] = _scored(true_arm, views, in_world, 0)
        if library is not None:
            rng = np.random.default_rng([seed, _LIBRARY])
            declare_true_objects(made, in_world, library, folder / "library", rng)
            made = made.declare(mesh_library=str(folder / "library"))
            _run(made, progress)
            figures[_WITH_PRIORS] = _scored(estimated_arm(made), views, in_world, clips)
    return figures


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    text = [
        f"{f['machine']}, {f['threads']} thread{'s' if f['threads'] > 1 else ''}",
        f"{f['scene']}: {f['captures']} captures, {f['frozen']} frozen views",
        "",
        f"{'':<16}{'PSNR dB':>9}{'SSIM':>8}{'unseen':>8}{'s a view':>10}{'corr.':>7}",
    ]
    arms = {name: f[name] for name in (_ESTIMATED, _WITH_PRIORS, _TRUE) if name in f}
    for name, arm in arms.items():
        text.append(
            f"{name.replace('_', ' '):<16}{arm['psnr']:>9.2f}{arm['ssim']:>8.3f}{arm['unseen']:>8.1%}"
            f"{arm['view_s']:>10.2f}{arm['confidence_correlation']:>7.2f}"
        )
    for name, arm in arms.items():
        shares = ", ".join(
            f"{cause.replace('_', ' ')} {one['error']:.0%} (of {one['pixels']:.0%}"
            + (")" if one["psnr"] is None else f", {one['psnr']:.1f} dB)")
            for cause, one in arm["causes"].items()
        )
        text.append(f"squared error, {name.replace('_', ' ')}: {shares}")
    for name, arm in arms.items():
        if arm["clips"]:
            worst = max(one["mean_difference"] for one in arm["clips"])
            cost = np.mean([one["frame_s"] for one in arm["clips"]])
            text.append(
                f"clips, {name.replace('_', ' ')}: {cost:.3f} s a frame, differences along the flow at most {worst:.4f}"
            )
    return text


def bundle_with_proxy(scene: Path, bundle: Path | None, path: Path, seed: int, progress: Progress) -> Scene:
    """A bundle of the captures in ``scene``, made at ``path`` up to its first proxy, or a copy of ``bundle``.

    Raises SceneError where that has no proxy.
    """
    if bundle is None:
        create_scene(path, scene, scene / "cameras.json", progress=progress)
        made = Scene.open(path).declare(overrides={"seed": seed})
        _run(made, progress)
        return made
    if not (bundle / of_round(0, "proxy") / "proxy.npz").is_file():
        raise SceneError("this bundle has no proxy", where=bundle, cure="Leave out --bundle, or refine it.")
    shutil.copytree(bundle, path)
    return Scene.open(path)


def _run(bundle: Scene, progress: Progress) -> None:
    """Lines 1 to 6 of Algorithm 1."""
    refine(bundle, progress, until=PROXY.of_round(0).name)


def estimated_arm(bundle: Scene) -> Arm:
    """The embedded generator on the proxy that the pipeline made."""
    proxy = bundle.read(PROXY.of_round(0))
    return _arm(bundle, proxy, bundle.read(CAPTURES))


def _true_arm(bundle: Scene, truth: GroundTruth) -> Arm:
    count = len(truth.faces)
    surface = GeometryProxy(
        truth.vertices.astype(np.float32),
        truth.faces,
        np.full(count, Provenance.OBSERVED, np.uint8),
        np.ones(count, np.uint16),
        np.ones(count, np.float32),
    )
    return _arm(bundle, surface, bundle.read(CAPTURES))


def _arm(bundle: Scene, proxy: GeometryProxy, captures: tuple[Capture, ...]) -> Arm:
    settings = bundle.declaration.settings
    observed = reliable_depths(captures, bundle.read(DEPTH), settings.stereo)
    renderer, depths = ZBufferRenderer(proxy), proxy_depths(captures, proxy)
    started_s = time.perf_counter()
    generator = BlendingGenerator(captures, depths, settings.generation, observed)
    return Arm(settings, captures, depths, renderer, generator, time.perf_counter() - started_s)


def _warm_up(arm: Arm, camera: Camera) -> None:
    """Compile the kernels, which is not counted."""
    arm.generator.generate(0, arm.renderer.render([camera.scaled(0.25)]))


def _scored(arm: Arm, views: Sequence[Capture], truth: GroundTruth, clips: int) -> dict[str, Any]:
    conditions = arm.renderer.render([view.camera for view in views])
    started_s = time.perf_counter()
    frames = [arm.generator.generate(0, [condition])[0] for condition in conditions]
    view_s = (time.perf_counter() - started_s) / len(views)
    images, truths = [frame.image for frame in frames], [view.image() for view in views]
    each = [(psnr(a, b), ssim(a, b)) for a, b in zip(images, truths, strict=True)]
    least = arm.settings.generation.hole_confidence
    return {
        "psnr": float(np.mean([one for one, _ in each])),
        "ssim": float(np.mean([one for _, one in each])),
        "views": {v.name: {"psnr": p, "ssim": s} for v, (p, s) in zip(views, each, strict=True)},
        "generator_s": round(arm.made_s, 3),
        "view_s": round(view_s, 4),
        "unseen": float(np.mean([frame.confidence <= least for frame in frames])),
        "confidence_correlation": _correlation(frames, truths),
        "causes": _causes(conditions, images, truths, truth),
        "clips": [_clip(arm, views[index]) for index in _spread(len(views), clips)],
    }


def _spread(count: int, wanted: int) -> list[int]:
    """Up to ``wanted`` of ``count`` indices, evenly spread."""
    return sorted(set(np.linspace(0, count - 1, min(count, wanted)).astype(int).tolist()))


def _correlation(frames: Sequence[Frame], truths: Sequence[np.ndarray]) -> float:
    """Spearman's, of uncertainty and absolute error over the pixels of all views."""
    uncertainty = np.concatenate([1.0 - frame.confidence[::4, ::4].ravel() for frame in frames])
    error = np.concatenate(
        [
            np.abs(frame.image - truth).mean(axis=-1)[::4, ::4].ravel()
            for frame, truth in zip(frames, truths, strict=True)
        ]
    )
    return float(spearmanr(uncertainty, error).statistic)


def _causes(
    conditions: Sequence[Condition], images: Sequence[np.ndarray], truths: Sequence[np.ndarray], truth: GroundTruth
) -> dict[str, dict[str, Any]]:
    room = MeshRasterizer(truth.vertices, truth.faces)
    cameras, depths = [view.camera for view in truth.views], [view.depth for view in truth.views]
    labels = [causes(c.camera, c.depth, room.render(c.camera).depth, cameras, depths) for c in conditions]
    shares = split(images, truths, labels)
    return {name: asdict(shares[name]) for name in CAUSES}


def _clip(arm: Arm, view: Capture) -> dict[str, Any]:
    """A whole clip towards a frozen pose, at the scale that clips have."""
    h = arm.settings
    captures = [capture.camera for capture in arm.captures]
    reference, _ = select_reference(view.camera, captures, arm.renderer.depth, arm.depths, h.selection)
    target = view.camera.scaled(h.generation.clip_scale)
    conditions = arm.renderer.render(camera_path(captures[reference], target, h.generation.clip_frames))
    started_s = time.perf_counter()
    frames = arm.generator.generate(reference, conditions)
    frame_s = (time.perf_counter() - started_s) / len(frames)
    differences = flow_differences(
        [frame.image for frame in frames], [c.camera for c in conditions], [c.depth for c in conditions]
    )
    return {
        "view": view.name,
        "reference": reference,
        "frame_s": round(frame_s, 4),
        "mean_difference": float(differences.mean()),
        "largest_difference": float(differences.max()),
    }
