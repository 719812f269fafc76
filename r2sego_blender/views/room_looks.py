"""What a room looks like to a camera, and bodies in it: as splats, or as the light that leaves a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..core.cameras import Camera
from ..core.images import to_uint8
from ..geometry.texture.surface_light_field import SurfaceLightField
from ..splats.kernels.packing import PackedGaussians
from ..splats.rendering.rasterizer import Rasterizer
from ..splats.rendering.surfaces import in_front

# Gaussians lie this much before what they show: else a foot would sink into the floor.
_BEFORE_M = 0.05
_LEAST_LIGHT = 1.0 / 512.0  # below it a body changes no level of its pixel


@dataclass(frozen=True)
class Sight:
    """What a camera sees at one moment.

    ``colour`` (H, W, 3) uint8, sRGB; ``depth_m`` (H, W) float32, planar, 0 where nothing is;
    ``body`` (H, W) bool, where a body of the simulation is seen and not the room.
    """

    colour: np.ndarray
    depth_m: np.ndarray
    body: np.ndarray


class RoomLooks(Protocol):
    """A room that a camera sees, in its world frame."""

    def seen(self, camera: Camera, bodies: tuple[np.ndarray, np.ndarray] | None) -> Sight:
        """The room, and bodies in it that have depth (H, W) float32 metres, 0 for none, and sRGB (H, W, 3)."""


class SplatLooks:
    """A visual asset, packed for the kernels once."""

    def __init__(self, asset: PackedGaussians) -> None:
        self._asset, self._rasterizer = asset, Rasterizer()

    def seen(self, camera: Camera, bodies: tuple[np.ndarray, np.ndarray] | None) -> Sight:
        """Without bodies ``render`` to the bit. A pixel is the body's share of what Gaussians before it let
        through, and theirs; ``Sight.body`` is where the greater part is a body's."""
        self._rasterizer.forward(self._asset, camera)
        room = self._rasterizer.rendering()
        body = np.zeros(camera.shape, bool)
        if bodies is not None:
            depth_m, colour = bodies
            before = in_front(self._rasterizer.tile_entries, np.where(depth_m > 0.0, depth_m - _BEFORE_M, 0.0))
            light = before.transmittance[..., None]
            reached = before.transmittance > _LEAST_LIGHT
            room.colour[reached] = (before.colour + light * colour)[reached]
            room.depth[reached] = (before.depth_sum + before.transmittance * depth_m)[reached]
            body = before.transmittance > 0.5
        return Sight(to_uint8(room.colour), room.depth, body)


class SurfaceLooks:
    """A mesh and the light that leaves it."""

    def __init__(self, field: SurfaceLightField) -> None:
        self._field = field

    def seen(self, camera: Camera, bodies: tuple[np.ndarray, np.ndarray] | None) -> Sight:
        """Without bodies ``SurfaceLightField.render`` to the bit; a body where it is nearer than the mesh."""
        colour, depth_m = self._field.render(camera)
        body = np.zeros(camera.shape, bool)
        if bodies is not None:
            body = (bodies[0] > 0.0) & ((depth_m == 0.0) | (bodies[0] < depth_m))
            depth_m[body], colour[body] = bodies[0][body], bodies[1][body]
        return Sight(to_uint8(colour), depth_m, body)
