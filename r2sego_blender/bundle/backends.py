"""What fills the slots of the paper: each result is shown with the name of what made it."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from ..config.settings import Settings
from ..config.slots import ESTIMATORS, GENERATORS, REGISTRARS, RENDERERS, SURFACES, TRAINERS
from ..core.json_files import read_json
from ..core.printable import printable
from . import layout

BACKENDS: Mapping[str, str] = {
    "initial_asset": "embedded: dense stereo to splats",
    "shape_prior": "embedded: room planes",
    "surface": SURFACES.labels["tsdf"],
    "controller": "embedded: reference motion tracked in MuJoCo",
    "conditions": RENDERERS.labels["z-buffer"],
    "generator": GENERATORS.labels["blending"],
    "registration": REGISTRARS.labels["pnp"],
    "splat_trainer": TRAINERS.labels["cpu"],
}
"""The backend of each slot of the paper; none of the defaults is a learned model."""

WITH_SENSOR = {"initial_asset": "embedded: dense stereo and a depth sensor to splats"}
"""Where a sensor measured depth beside the photographs."""

ESTIMATOR = "depth_estimator"
"""The slot that is empty by default: no bundle names a backend of it but one with estimates."""

WITH_RECORDED = {ESTIMATOR: ESTIMATORS.labels["recorded"]}
"""Where depth maps of any origin were recorded; whether a model made them nobody here knows."""


_BY_LAYOUT = {ESTIMATOR: "embedded: the room's layout"}


def chosen_backends(settings: Settings) -> dict[str, str]:
    """The backends that settings choose."""
    return {
        "surface": SURFACES.labels[settings.proxy.surface],
        "conditions": RENDERERS.labels[settings.generation.renderer],
        "generator": GENERATORS.labels[settings.generation.generator],
        "registration": REGISTRARS.labels[settings.registration.registrar],
        "splat_trainer": TRAINERS.labels[settings.training.backend],
    }


def controller_backend(bundle: Path) -> dict[str, str]:
    """The controller that drove the last rollouts of ``bundle``; empty for the embedded one.

    A learned policy is named as such; what is embedded says so.
    """
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError):
        told = sorted(bundle.glob("rounds/*/rollouts/rollouts.json"), key=lambda file: int(file.parts[-3]))
        controller = printable(read_json(told[-1])["rollouts"][-1]["controller"])
        if controller.startswith(("policy", "student", "twist2")):
            return {"controller": controller}
        if controller.startswith("replay"):
            return {"controller": f"embedded: {controller}, tracked in MuJoCo"}
    return {}


def layout_backend(bundle: Path) -> dict[str, str]:
    """The room's layout, where it is what estimated depth of ``bundle``; empty elsewhere."""
    by_layout = (bundle / layout.ESTIMATED).is_dir() and not (bundle / layout.ESTIMATES).is_dir()
    return dict(_BY_LAYOUT) if by_layout else {}
