"""Settings by name: presets, and single settings by their dotted keys."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..core.errors import SettingsError
from .settings import Settings

EVERY_PIXEL: Mapping[str, float] = {"every_third_pixel_share": 0.0, "every_second_pixel_share": 0.0}
"""TrainingSettings whose steps look at whole images."""

UNREGULARISED: Mapping[str, Any] = {"max_scale_m": 0.0, "dropout_share": 0.0, "sh_degree": 3}
"""TrainingSettings that leave Gaussians as the images alone would have them.

What many photographs see from all sides needs no more; 3DGS has no more.
"""

VANILLA_3DGS: Mapping[str, Any] = {
    **EVERY_PIXEL,
    **UNREGULARISED,
    "first_gaussians": "spheres",
    "densification": "original",
    "scale_rate": 0.005,
    "rotation_rate": 1e-3,
    "colour_rate": 2.5e-3,
    "opacity_rate": 0.05,
    "densify_from_share": 500 / 30000,
    "densify_until_share": 0.5,
}
"""TrainingSettings of the original 3DGS (Kerbl et al. 2023), which has 30,000 steps.

What is counted in steps there keeps its number, what ends at a step its share of them.
"""

MANY_PHOTOGRAPHS: Mapping[str, Any] = {
    **UNREGULARISED,
    "first_gaussians": "discs",
    "densification": "growth",
    "densify_until_share": 0.4,
    "every_third_pixel_share": 0.8,
    "every_second_pixel_share": 0.2,
    "rate_swing": 3.0,
    "scale_rate": 0.04,
}
"""TrainingSettings of ``r2sego train``: many photographs and a few points to start from.

Measured on dense captures of three rooms, see docs/splats.md. A handful of photographs
would be learnt by heart so.
"""

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "paper": {},
    "preview": {
        "rounds": 2,
        "selection.scoring_scale": 0.25,
        "generation.clip_frames": 7,
        "generation.kept_conditions": "target",
        "training.steps_per_round": 900,
        "training.max_gaussians": 120000,
        "training.dropout_share": 0.0,
        "training.later_rounds_rate": 1.0,
        "training.disc_stride_px": 3,
        "training.detailed_share": 1.0,
        "training.every_third_pixel_share": 0.6,
        "training.every_second_pixel_share": 0.4,
    },
}
"""Named sets of overrides; ``paper`` is the dataclasses' own defaults."""


@dataclass(frozen=True)
class Entry:
    """One setting as the command line and the panels show it."""

    key: str
    default: Any
    doc: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    changes_result: bool
    added: bool


def entries(settings: Settings = Settings()) -> Iterator[Entry]:
    """Every setting with its dotted key, in the order of ``settings.py``."""
    for item in dataclasses.fields(settings):
        value = getattr(settings, item.name)
        if not dataclasses.is_dataclass(value):
            yield Entry(item.name, value, **item.metadata)
            continue
        for inner in dataclasses.fields(value):
            yield Entry(f"{item.name}.{inner.name}", getattr(value, inner.name), **inner.metadata)


def differing(settings: Settings, base: Settings) -> dict[str, Entry]:
    """Those of ``settings`` that have another value than in ``base``, by key."""
    pairs = zip(entries(settings), entries(base), strict=True)
    return {own.key: own for own, other in pairs if own.default != other.default}


def with_overrides(overrides: Mapping[str, Any], base: Settings = Settings()) -> Settings:
    """``base`` with dotted keys replaced; values may be strings from a command line.

    Raises SettingsError naming the key, the closest known key, or the allowed range.
    """
    known = {entry.key: entry for entry in entries(base)}
    sections: dict[str, dict[str, Any]] = {}
    for key, raw in overrides.items():
        if key not in known:
            close = [k for k in known if k.startswith(key)]
            close += difflib.get_close_matches(key, known, n=1, cutoff=0.4)
            hint = f"Did you mean {close[0]}?" if close else "See docs/settings.md."
            raise SettingsError(f"there is no setting '{key}'", where="settings", cure=hint)
        section, _, name = key.rpartition(".")
        sections.setdefault(section, {})[name] = _parsed(known[key], raw)
    # Each section at once: what its settings must keep to together holds at the end only.
    changed = sections.pop("", {})
    changed |= {name: dataclasses.replace(getattr(base, name), **new) for name, new in sections.items()}
    return dataclasses.replace(base, **changed)


def preset(name: str) -> Settings:
    """The settings of a named preset. Raises SettingsError for an unknown name."""
    if name not in PRESETS:
        raise SettingsError(
            f"there is no preset '{name}'", where="settings", cure=f"Known: {', '.join(PRESETS)}."
        )
    return with_overrides(PRESETS[name])


def _parsed(entry: Entry, raw: Any) -> Any:
    kind = type(entry.default)
    try:
        if kind is int and not isinstance(raw, str) and raw != int(raw):
            raise ValueError
        value = kind(raw)
    except (TypeError, ValueError, OverflowError) as error:
        raise SettingsError(
            f"'{raw}' is not {'a whole number' if kind is int else 'a number'}",
            where=f"setting {entry.key}", cure=f"The default is {entry.default}.",
        ) from error  # fmt: skip
    if entry.choices and value not in entry.choices:
        raise SettingsError(
            f"'{value}' is not known", where=f"setting {entry.key}",
            cure=f"Give one of {', '.join(entry.choices)}.",
        )  # fmt: skip
    below = entry.low is not None and not value >= entry.low
    above = entry.high is not None and not value <= entry.high
    if below or above:
        raise SettingsError(
            f"{value} is out of range", where=f"setting {entry.key}",
            cure=f"Give a value from {entry.low} to {entry.high}.",
        )  # fmt: skip
    return value
