"""Geometry-guided blending: every capture projected onto the proxy.

A pixel of a structural condition is a point of the proxy. Each capture that sees that
point, by its own depth, offers a colour; the best few are averaged with weights that fall
to zero where a capture drops out (the penalties of the Unstructured Lumigraph, Buehler et
al. 2001). So at a capture's own pose its photograph comes back, and elsewhere there are no
seams. Photographs are read bicubically (Catmull and Rom): bilinear reading blurs. A capture
that shows another colour than the rest loses weight: it sees something else, such as a thin
leg that the proxy lacks.

Points that no capture saw have the colour of their surface, continued in 3D
(``surface_colours``) and joined to the colours seen around them. What is uncertain is softened
(``uncertainty``).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...captures.capture import Capture
from ...config.settings import GenerationSettings
from ...core.compiled import inlined, parallel_kernel, prange
from ...core.errors import GenerationError
from ...geometry.visibility.point_visibility import PROXY_ROUGHNESS_M
from ...geometry.visibility.projection import NEAR_M
from ..conditions.conditions import Condition
from .hole_filling import fill_holes
from .slot import ClipInputs, Frame, Generator, Installation
from .surface_colours import SurfaceColours
from .uncertainty import soften_uncertain
from .visibility import capture_trust

BACKENDS = {"blending": "embedded: geometry-guided blending"}
ORDER = 0

# A capture exactly at the target's angle has penalty 0 and weight 1/penalty; this, about
# a tenth of a degree, keeps the weight finite.
_SMALLEST_PENALTY = np.float32(2e-3)
_SMALLEST_WEIGHT = np.float32(1e-6)  # when the best captures and the next are equal
# Colours that differ by this (standard deviation, of 1) cut the confidence to 1/e.
_DISAGREEMENT = np.float32(0.15)
# A capture whose colour differs by this from all others', over the channels, weighs about a
# quarter of what it would if they agreed.
_DISSENT = np.float32(0.1)
# A capture twice as coarse as the target costs as much as an angle of about six degrees.
_COARSENESS_PENALTY = np.float32(0.1)
# A capture's depth that differs as far as it may costs as much as twelve degrees.
_DEPTH_PENALTY = np.float32(0.2)
# How far a pixel that no capture saw is known by its surface's colour elsewhere: colours seen
# within some eight pixels on its own plane join it to them.
_GUESS = np.float32(0.1)


class _Photographs(NamedTuple):
    """The captures as the kernels read them, pixels of all in one row.

    ``pose`` (N, 3, 4) float32 camera_from_world; ``centre`` (N, 3) float32; ``lens``
    (N, 4) float32 fx, fy, cx, cy; ``size`` (N, 2) int64 width, height; ``start`` (N,)
    int64 first pixel; ``colour`` (P, 3) float32; ``depth`` and ``trust`` (P,) float32.
    """

    pose: np.ndarray
    centre: np.ndarray
    lens: np.ndarray
    size: np.ndarray
    start: np.ndarray
    colour: np.ndarray
    depth: np.ndarray
    trust: np.ndarray


class BlendingGenerator:
    """The embedded generator: all captures blended onto the proxy, holes filled."""

    name = "geometry-guided blending"

    def __init__(
        self,
        captures: Sequence[Capture],
        capture_depths: Sequence[np.ndarray],
        settings: GenerationSettings,
        observed_depths: Sequence[np.ndarray] | None = None,
    ) -> None:
        """``capture_depths``: the proxy's depth in each capture, (H, W) of its camera, metres.

        ``observed_depths``, when given, are the captures' own reliable depth maps, (H, W),
        0 = unknown: where they contradict the proxy, a capture's colour is hardly used.
        """
        if not captures:
            raise GenerationError("there are no captures to blend", cure="Import the photographs again.")
        cameras = [capture.camera for capture in captures]
        if [np.shape(depth) for depth in capture_depths] != [camera.shape for camera in cameras]:
            raise ValueError("each capture needs one depth map of its camera's size")
        images = [capture.image() for capture in captures]
        observed = observed_depths or list[np.ndarray | None]([None] * len(captures))
        trusts = [
            capture_trust(depth, seen, settings) * np.float32(capture.weight)
            for capture, depth, seen in zip(captures, capture_depths, observed, strict=True)
        ]
        areas = [camera.width * camera.height for camera in cameras]
        self._settings = settings
        self._surface = SurfaceColours(images, cameras, capture_depths, trusts)
        self._photographs = _Photographs(
            pose=np.stack([c.camera_from_world[:3] for c in cameras]).astype(np.float32),
            centre=np.stack([c.centre for c in cameras]).astype(np.float32),
            lens=np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras], np.float32),
            size=np.array([[c.width, c.height] for c in cameras], np.int64),
            start=np.concatenate([[0], np.cumsum(areas)[:-1]]).astype(np.int64),
            colour=np.concatenate([image.reshape(-1, 3) for image in images]),
            depth=np.concatenate([np.ravel(d) for d in capture_depths]).astype(np.float32),
            trust=np.concatenate([np.ravel(t) for t in trusts]),
        )

    def generate(self, reference: int, conditions: Sequence[Condition]) -> list[Frame]:
        """See ``Generator``; every capture is used, the reference as any other."""
        return [self.blend(condition) for condition in conditions]

    def blend(self, condition: Condition, seen: bool = True) -> Frame:
        """All captures blended onto one condition.

        Raises GenerationError when no capture sees anything of it, unless it need not be ``seen``: such a
        frame has the surfaces' colours as they are continued.
        """
        camera, settings = condition.camera, self._settings
        pose = camera.world_from_camera.astype(np.float32)
        image, confidence = _blend(
            condition.depth,
            pose,
            np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32),
            self._photographs,
            settings.best_captures,
            np.float32(settings.depth_tolerance),
            np.float32(settings.border_px),
        )
        known = confidence > 0.0
        if seen and not known.any():
            raise GenerationError(
                "no capture sees anything of the target view", cure="Photograph that side of the room."
            )
        points = (camera.rays() * condition.depth[..., None]) @ camera.world_from_camera[:3, :3].T
        guessed = ~known & (condition.depth > 0.0)
        image[guessed] = self._surface.at(camera.centre + points[guessed], condition.normal[guessed])
        image = fill_holes(image, known + _GUESS * guessed, points, condition.normal)
        confidence = np.where(known, np.maximum(confidence, settings.hole_confidence), settings.hole_confidence)
        confidence = confidence.astype(np.float32)
        return Frame(np.clip(soften_uncertain(image, confidence), 0.0, 1.0), confidence)


def installation(name: str, settings: GenerationSettings) -> Installation:
    """The embedded generator is always there, and depends on its inputs and settings alone."""
    return Installation({})


@contextlib.contextmanager
def make(installed: Installation, inputs: ClipInputs) -> Iterator[Generator]:
    """The embedded generator of these captures."""
    yield BlendingGenerator(inputs.captures, inputs.depths, inputs.settings.generation, inputs.observed)


@inlined
def _catmull_rom(f):
    """The shares of four neighbours at ``f`` from the second to the third."""
    half, one = np.float32(0.5), np.float32(1.0)
    g = one - f
    return (
        -half * f * g * g,
        one - half * f * f * (np.float32(5.0) - np.float32(3.0) * f),
        one - half * g * g * (np.float32(5.0) - np.float32(3.0) * g),
        -half * g * f * f,
    )


@inlined
def _penalty(point, ray, z, fx, photographs, j, tolerance, border_px):
    """How little capture ``j`` tells of a point, and where it shows it, pixels; infinite where it does not.

    ``point`` lies at depth ``z`` on the target's ``ray``, a direction and its length; ``fx`` is the target's.
    """
    x, y, w = point
    dx, dy, dz, length = ray
    nothing = (np.float32(np.inf), np.float32(0.0), np.float32(0.0))
    pose, lens = photographs.pose[j], photographs.lens[j]
    cz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * w + pose[2, 3]
    if cz <= NEAR_M:
        return nothing
    cx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * w + pose[0, 3]
    cy = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * w + pose[1, 3]
    u = cx / cz * lens[0] + lens[2]
    v = cy / cz * lens[1] + lens[3]
    wide, high = photographs.size[j, 0], photographs.size[j, 1]
    if not (u > 0.0 and v > 0.0 and u < wide and v < high):
        return nothing
    pixel = photographs.start[j] + np.int64(v) * wide + np.int64(u)
    trust = photographs.trust[pixel]
    apart = abs(photographs.depth[pixel] - cz) / (tolerance * cz + PROXY_ROUGHNESS_M)
    if trust <= 0.0 or apart > 1.0:
        return nothing
    if border_px > 0.0:
        margin = min(min(u, wide - u), min(v, high - v))
        trust *= min(max(margin / border_px, np.float32(0.02)), np.float32(1.0))
    centre = photographs.centre[j]
    ox, oy, oz = x - centre[0], y - centre[1], w - centre[2]
    far = np.sqrt(ox * ox + oy * oy + oz * oz)
    cosine = (ox * dx + oy * dy + oz * dz) / (far * length)
    angle = np.sqrt(max(np.float32(2.0) * (np.float32(1.0) - cosine), np.float32(0.0)))
    coarse = max(cz * fx / (z * lens[0]) - np.float32(1.0), np.float32(0.0))
    penalty = angle + _COARSENESS_PENALTY * coarse + _DEPTH_PENALTY * apart + _SMALLEST_PENALTY
    return penalty / trust, u, v


@inlined
def _read_bicubically(photographs, j, u, v, colour):
    """Write the colour (3,) of capture ``j`` at a place in pixels."""
    wide, high = photographs.size[j, 0], photographs.size[j, 1]
    a = min(max(u - np.float32(0.5), np.float32(0.0)), np.float32(wide - 1))
    b = min(max(v - np.float32(0.5), np.float32(0.0)), np.float32(high - 1))
    a0, b0 = min(np.int64(a), wide - 2), min(np.int64(b), high - 2)
    across, down = _catmull_rom(a - np.float32(a0)), _catmull_rom(b - np.float32(b0))
    for c in range(3):
        colour[c] = np.float32(0.0)
    for i in range(4):
        line = photographs.start[j] + min(max(b0 + i - 1, 0), high - 1) * wide
        for m in range(4):
            share = down[i] * across[m]
            pixel = line + min(max(a0 + m - 1, 0), wide - 1)
            for c in range(3):
                colour[c] += share * photographs.colour[pixel, c]


@inlined
def _mean_of_agreeing(colour, share_of, used, mean):
    """Write the mean (3,) of so many colours (n, 3) by their shares, less of those that show another than the rest.

    Returns how far they spread around it.
    """
    together = np.float32(0.0)
    for k in range(used):
        together += share_of[k]
    total = np.float32(0.0)
    for k in range(used):
        agreed = np.float32(0.0)
        for i in range(used):
            gap = np.float32(0.0)
            for c in range(3):
                d = colour[k, c] - colour[i, c]
                gap += d * d
            agreed += share_of[i] / (np.float32(1.0) + gap / (_DISSENT * _DISSENT))
        agreed /= together
        weight = share_of[k] * agreed * agreed
        total += weight
        for c in range(3):
            mean[c] += weight * colour[k, c]
    for c in range(3):
        mean[c] /= total
    spread = np.float32(0.0)
    for k in range(used):
        for c in range(3):
            d = colour[k, c] - mean[c]
            spread += d * d / (3 * used)
    return spread


@parallel_kernel
def _blend(depth, pose, lens, photographs, best, tolerance, border_px):
    """(H, W, 3) float32 colour and (H, W) float32 confidence, 0 where no capture sees."""
    height, width = depth.shape
    image = np.zeros((height, width, 3), np.float32)
    confidence = np.zeros((height, width), np.float32)
    for row in prange(height):
        # the best captures so far, by rising penalty, and the one after them
        penalty = np.empty(best + 1, np.float32)
        which = np.empty(best + 1, np.int64)
        place = np.empty((best + 1, 2), np.float32)
        colour = np.empty((best + 1, 3), np.float32)
        share_of = np.empty(best + 1, np.float32)
        for column in range(width):
            z = depth[row, column]
            if z <= 0.0:
                continue
            rx = (np.float32(column) + np.float32(0.5) - lens[2]) / lens[0]
            ry = (np.float32(row) + np.float32(0.5) - lens[3]) / lens[1]
            dx = pose[0, 0] * rx + pose[0, 1] * ry + pose[0, 2]
            dy = pose[1, 0] * rx + pose[1, 1] * ry + pose[1, 2]
            dz = pose[2, 0] * rx + pose[2, 1] * ry + pose[2, 2]
            point = (pose[0, 3] + z * dx, pose[1, 3] + z * dy, pose[2, 3] + z * dz)
            ray = (dx, dy, dz, np.sqrt(dx * dx + dy * dy + dz * dz))
            found = 0
            for j in range(len(photographs.start)):
                p, u, v = _penalty(point, ray, z, lens[0], photographs, j, tolerance, border_px)
                if not p < np.inf or (found > best and p >= penalty[best]):
                    continue
                position = min(found, best)
                while position > 0 and penalty[position - 1] > p:
                    penalty[position] = penalty[position - 1]
                    which[position] = which[position - 1]
                    place[position, 0], place[position, 1] = place[position - 1, 0], place[position - 1, 1]
                    position -= 1
                penalty[position] = p
                which[position] = j
                place[position, 0], place[position, 1] = u, v
                found = min(found + 1, best + 1)
            if found == 0:
                continue
            used = min(found, best)
            for k in range(used):
                _read_bicubically(photographs, which[k], place[k, 0], place[k, 1], colour[k])
                share_of[k] = np.float32(1.0) / penalty[k]
                if found > best:
                    share_of[k] -= np.float32(1.0) / penalty[best]
                share_of[k] += _SMALLEST_WEIGHT
            spread = _mean_of_agreeing(colour, share_of, used, image[row, column])
            trusted = np.exp(-penalty[0] - spread / (_DISAGREEMENT * _DISAGREEMENT))
            confidence[row, column] = max(trusted, _SMALLEST_WEIGHT)  # 0 means unseen
    return image, confidence
