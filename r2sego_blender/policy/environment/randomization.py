"""What differs from episode to episode besides the start: how the head sees, and how the robot moves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...config.fields import Range, setting
from ...views.head_image import HeadView

_STILL: Range = (1.0, 1.0)


@dataclass(frozen=True)
class Randomization:
    """Ranges that each episode draws from; camera and latency as GaussGym has them."""

    mount_m: float = setting(0.02, "Most the head camera is moved along each of its axes.", 0.0, 0.5)
    mount_rad: float = setting(0.03, "Most the head camera is turned about each of its axes.", 0.0, 0.5)
    focal_share: float = setting(0.01, "Standard deviation of the focal length, a share of it.", 0.0, 0.1)
    exposure_stops: float = setting(0.3, "Most the exposure is off, in stops.", 0.0, 3.0)
    white_balance_stops: float = setting(0.1, "Most red and blue are off against green, in stops.", 0.0, 1.0)
    light_deg: float = setting(60.0, "Most the light that shades bodies is off the vertical.", 0.0, 90.0)
    latency_s: Range = setting((0.05, 0.15), "How old the picture is that is shown.", 0.0, 1.0)
    friction: Range = setting((0.7, 1.3), "Factor of the friction of everything.", 0.1, 10.0)
    mass: Range = setting((0.95, 1.05), "Factor of the robot's masses and inertias.", 0.5, 2.0)

    @staticmethod
    def none() -> Randomization:
        """Everything as it is declared, and pictures of now."""
        return Randomization(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0), _STILL, _STILL)

    def drawn(self, rng: np.random.Generator, view: HeadView) -> Drawn:
        """One episode's, where the robot's camera is ``view``. As many numbers are drawn whatever the ranges."""
        moved, turned = (rng.uniform(-1.0, 1.0, 3) * most for most in (self.mount_m, self.mount_rad))
        mount = np.eye(4)
        mount[:3, :3] = Rotation.from_rotvec(turned).as_matrix()
        mount[:3, 3] = moved
        # Four standard deviations at most: a lens of no focal length sees nothing.
        focal = 1.0 + self.focal_share * float(np.clip(rng.normal(), -4.0, 4.0))
        exposure = rng.uniform(-1.0, 1.0) * self.exposure_stops
        red, blue = rng.uniform(-1.0, 1.0, 2) * self.white_balance_stops
        tilt, around = rng.uniform(0.0, 1.0) * math.radians(self.light_deg), rng.uniform(-math.pi, math.pi)
        lens = replace(view.lens, fx=view.lens.fx * focal, fy=view.lens.fy * focal)
        gains = float(2.0 ** (exposure + red)), float(2.0**exposure), float(2.0 ** (exposure + blue))
        light = math.sin(tilt) * math.cos(around), math.sin(tilt) * math.sin(around), math.cos(tilt)
        seen = HeadView(lens, view.parent_from_camera @ mount, gains, light)
        latency_s, friction, mass = (
            float(rng.uniform(*limits)) for limits in (self.latency_s, self.friction, self.mass)
        )
        return Drawn(seen, latency_s, friction, mass)


@dataclass(frozen=True)
class Drawn:
    """What one episode drew: its ``view``, how old pictures are, and the factors of friction and mass."""

    view: HeadView
    latency_s: float
    friction: float
    mass: float
