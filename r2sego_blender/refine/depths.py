"""Depth maps (H, W) in planar metres at the captures' own sizes, 0 where nothing is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..captures.capture import Capture
from ..captures.per_capture import PerCapture
from ..config.settings import StereoSettings
from ..core.images import resize_nearest
from ..generation.conditions.conditions import ZBufferRenderer
from ..geometry.estimators.aligned_depth import AlignedDepth
from ..geometry.proxy.proxy import GeometryProxy
from ..geometry.room.completed_depth import CompletedDepth
from ..geometry.stereo.stereo import DepthMap


def reliable_depths(
    captures: Sequence[Capture], maps: PerCapture[DepthMap], settings: StereoSettings
) -> list[np.ndarray]:
    """Each capture's reliable stereo depth."""
    return [
        resize_nearest(np.where(m.reliable(settings), m.depth, 0.0), *capture.camera.shape)
        for capture, m in zip(captures, maps.of(captures), strict=True)
    ]


def carried_depths(
    captures: Sequence[Capture], depths: Sequence[np.ndarray], estimated: PerCapture[AlignedDepth], carried: np.ndarray
) -> list[np.ndarray]:
    """``depths``, and where these know nothing the estimate of captures that are ``carried`` (N,) bool by it."""
    return [
        np.where((depth <= 0.0) & is_carried, resize_nearest(one.depth, *capture.camera.shape), depth)
        for capture, depth, one, is_carried in zip(captures, depths, estimated.of(captures), carried, strict=True)
    ]


def completed_depths(captures: Sequence[Capture], completed: PerCapture[CompletedDepth]) -> list[np.ndarray]:
    """Each capture's depth without holes."""
    return [
        resize_nearest(one.depth, *capture.camera.shape)
        for capture, one in zip(captures, completed.of(captures), strict=True)
    ]


def proxy_depths(captures: Sequence[Capture], proxy: GeometryProxy) -> list[np.ndarray]:
    """The proxy's depth in each capture, float32."""
    renderer = ZBufferRenderer(proxy)
    return [renderer.depth(capture.camera) for capture in captures]
