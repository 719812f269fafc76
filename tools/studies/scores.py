"""Scores of a bundle's depth, surface and refined asset against ground truth, and of stated against actual errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.evaluation.exposure.exposures import exposures_of
from r2sego_blender.evaluation.frozen import score
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.evaluation.ground_truth import GroundTruth
from r2sego_blender.evaluation.surfaces.geometry_errors import within
from r2sego_blender.geometry.estimators.aligned_depth import ESTIMATED
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.geometry.room.completed_depth import COMPLETED, DepthSource
from r2sego_blender.splats.artifacts import REFINED_ASSET
from tools.benchmarks.truth.geometry_scores import mesh_score

from .disturbed_depth import mean_relative_error

Maps = Sequence[np.ndarray]

_SCORING = 0  # the benchmarks' stream of random numbers for it
_TO_SIGMA = 1.4826  # of a median absolute deviation
_TOLERANCES = (0.05, 0.10)
_ROUNDS, _LEAST_ERROR = 15, 1e-3


def calibration(depths: Maps, sigmas: Maps, true: Maps) -> dict[str, float]:
    """How far off estimates are and how far they say they are, over all their pixels with a true depth.

    ``valid``: their share of the pixels with one; ``stated`` the median relative sigma; ``measured`` the robust
    relative standard deviation; ``within_1``, ``within_2`` and ``within_3`` the shares that lie within as many sigmas,
    68, 95 and 99.7 % for normal errors. Logarithms of ratios are compared.
    """
    off, sigma, pixels = [], [], 0
    for depth, doubt, truth in zip(depths, sigmas, true, strict=True):
        both = (depth > 0.0) & (truth > 0.0)
        off.append(np.abs(np.log(depth[both] / truth[both])))
        sigma.append(doubt[both])
        pixels += int((truth > 0.0).sum())
    errors, stated = np.concatenate(off), np.concatenate(sigma)
    if not len(errors):
        return {"valid": 0.0}
    shares = {f"within_{count}": float((errors <= count * stated).mean()) for count in (1, 2, 3)}
    return {
        "valid": len(errors) / pixels,
        "stated": float(np.median(stated)),
        "measured": _TO_SIGMA * float(np.median(errors)),
        **shares,
    }


def given_scores(depths: Maps, true: Maps) -> dict[str, float]:
    """Of estimates in any unit, each brought to the truth by the scale and shift of least relative error, as
    tables of models do: ``absrel``, the mean of their mean relative errors, and the shares within 5 and 10 %."""
    fitted = [_fitted(depth, truth) for depth, truth in zip(depths, true, strict=True)]
    errors = [mean_relative_error(depth, truth) for depth, truth in zip(fitted, true, strict=True)]
    return {"absrel": float(np.mean(errors)), **_shares(fitted, true)}


def _fitted(depth: np.ndarray, true: np.ndarray) -> np.ndarray:
    both = (depth > 0.0) & (true > 0.0)
    rows = np.stack([depth[both], np.ones(int(both.sum()))], axis=1) / true[both][:, None]
    weight = np.ones(len(rows))
    for _ in range(_ROUNDS):  # least absolute errors by weighted least squares
        found = np.linalg.lstsq(rows * weight[:, None], weight, rcond=None)[0]
        weight = 1.0 / np.sqrt(np.maximum(np.abs(rows @ found - 1.0), _LEAST_ERROR))
    return np.where(both, found[0] * depth + found[1], 0.0)


def depth_scores(bundle: Scene, truth: GroundTruth, without: Scene | None = None) -> dict[str, Any]:
    """Of the completed depth, of each of its sources, and of the aligned estimates where there are any, all over and
    where nothing was seen.

    ``truth`` is in the frame of the photographs' own poses. With the bundle ``without`` estimates also of the ``best``
    that can be made of its depth and the estimates: what was seen there stays, elsewhere the truth chooses.
    """
    captures = bundle.read(CAPTURES)
    completed = bundle.read(COMPLETED).of(captures)
    sizes = [one.depth.shape for one in completed]
    views = _in_world(bundle, truth).views
    true = [resize_nearest(view.depth, *size) for view, size in zip(views, sizes, strict=True)]
    found = [one.depth for one in completed]
    scores: dict[str, Any] = {"completed": _shares(found, true), "sources": {}}
    pixels = sum(int((one > 0.0).sum()) for one in true)
    for source in DepthSource:
        here = [np.where(one.source == source, each, 0.0) for one, each in zip(completed, true, strict=True)]
        count = sum(int((one > 0.0).sum()) for one in here)
        if count:
            scores["sources"][source.name.lower()] = {"share": count / pixels, **_shares(found, here)}
    if (bundle.path / ESTIMATED.name).is_dir():
        aligned = bundle.read(ESTIMATED).of(captures)
        depths = [one.depth for one in aligned]
        sigmas = [one.sigma for one in aligned]
        unseen = [np.where(one.seen, 0.0, each) for one, each in zip(completed, true, strict=True)]
        scores["estimate"] = {**_shares(depths, true), **calibration(depths, sigmas, true)}
        scores["estimate"]["unseen"] = calibration(depths, sigmas, unseen)
        if without is not None and (without.path / COMPLETED.name).is_dir():
            before = without.read(COMPLETED).of(captures)
            scores["best"] = _shares(
                [
                    np.where(one.seen, one.depth, nearer_to(each, one.depth, depth))
                    for one, depth, each in zip(before, depths, true, strict=True)
                ],
                true,
            )
    return scores


def nearer_to(true: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Pixel by pixel that of two depth maps (H, W) which lies nearer to the true one."""
    closer: np.ndarray = np.where(np.abs(other - true) < np.abs(one - true), other, one)
    return closer


def proxy_scores(bundle: Scene, truth: GroundTruth) -> dict[str, float]:
    """Of the first round's proxy: precision, recall and F-score at 5 cm, the median error in metres."""
    proxy = bundle.read(PROXY.of_round(0))
    rng = np.random.default_rng([bundle.declaration.settings.seed, _SCORING])
    return dict(vars(mesh_score(proxy.vertices, proxy.faces, _in_world(bundle, truth), rng)))


def view_scores(bundle: Scene, cameras: Path) -> dict[str, float]:
    """PSNR in dB and SSIM of the refined asset, means over the frozen views of ``cameras``, a cameras.json."""
    exposed = exposures_of(bundle).renderer(bundle.read(REFINED_ASSET))
    found = score(lambda camera: exposed(camera).colour, frozen_views(bundle, cameras).views)
    return {"psnr": found.psnr, "ssim": found.ssim}


def _shares(found: Maps, true: Maps) -> dict[str, float]:
    return {f"within_{round(100 * tolerance)}_percent": within(found, true, tolerance) for tolerance in _TOLERANCES}


def _in_world(bundle: Scene, truth: GroundTruth) -> GroundTruth:
    return truth.transformed(np.array(bundle.declaration.world_from_capture))
