"""Stereo and the depth of a sensor as one: each where it is the surer.

Where both agree, stereo's detail stays and the sensor's level counts; where stereo found nothing, or
something else, the sensor decides. What no sensor reached is stereo's alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ...captures.capture import Capture
from ...captures.sensors.cleaning import normals
from ...captures.sensors.sensor_maps import SensorMap
from ...captures.sensors.upsampling import upsampled
from ...config.settings import StereoSettings
from ...core.images import resize
from .consistency import support
from .stereo import DepthMap

_AGREES = 3.0
"""Sigmas by which the two may differ where they see one surface."""

_LEVEL_RADIUS_PX = 7  # over which the sensor's level is averaged: its noise is no detail


def with_sensor(
    depth_maps: Sequence[DepthMap],
    captures: Sequence[Capture],
    sensor: Sequence[SensorMap | None],
    settings: StereoSettings,
) -> tuple[DepthMap, ...]:
    """The captures' stereo with what a sensor measured of each, None where there was none."""
    fused = [
        depth_map if one is None else _fused(depth_map, capture, one, settings)
        for depth_map, capture, one in zip(depth_maps, captures, sensor, strict=True)
    ]
    counts = support(
        [one.camera for one in fused],
        [one.depth for one in fused],
        [one.normal for one in fused],
        [one.reliable(settings) for one in fused],
        settings.consistency,
    )
    return tuple(
        one if one.measured is None else replace(one, support=np.where(one.measured, count, one.support))
        for one, count in zip(fused, counts, strict=True)
    )


def _fused(depth_map: DepthMap, capture: Capture, sensor: SensorMap, settings: StereoSettings) -> DepthMap:
    camera = depth_map.camera
    image = resize(capture.image(), camera.width, camera.height)
    depth, sigma = upsampled(sensor, image, camera)
    normal, _ = normals(depth, camera)
    stereo = depth_map.depth
    known = depth > 0.0
    tolerance = _AGREES * np.hypot(sigma, settings.consistency * depth)
    agree = known & depth_map.reliable(settings) & (np.abs(stereo - depth) <= tolerance)
    level = _averaged(np.where(agree, np.log(np.where(agree, depth / np.maximum(stereo, 1e-6), 1.0)), 0.0), agree)
    measured = known & ~agree
    cost = np.minimum(sigma / np.maximum(depth, 1e-6) / settings.consistency, 1.0) * settings.max_cost
    return replace(
        depth_map,
        depth=np.where(measured, depth, np.where(agree, stereo * np.exp(level), stereo)).astype(np.float32),
        normal=np.where(measured[..., None], normal, depth_map.normal),
        cost=np.where(measured, cost, depth_map.cost).astype(np.float32),
        measured=measured,
    )


def _averaged(values: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The mean of the kept values in a window around each pixel."""
    side = 2 * _LEVEL_RADIUS_PX + 1
    total, count = (
        cv2.boxFilter(part.astype(np.float32), -1, (side, side), normalize=False) for part in (values, kept)
    )
    return np.where(kept, total / np.maximum(count, 1.0), 0.0)
