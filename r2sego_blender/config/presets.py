"""Settings by name: presets, and single settings by their dotted keys."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..core.errors import SettingsError
from .declared_files import Reader, did_you_mean
from .fields import Field, fields_of
from .settings import Settings

EVERY_PIXEL: Mapping[str, float] = {"every_third_pixel_share": 0.0, "every_second_pixel_share": 0.0}
"""TrainingSettings whose steps look at whole images."""

UNREGULARISED: Mapping[str, Any] = {"max_scale_m": 0.0, "dropout_share": 0.0, "sh_degree": 3}
"""TrainingSettings that leave Gaussians as the images alone would have them.

What many photographs see from all sides needs no more; 3DGS has no more.
"""

UNBOUNDED: Mapping[str, Any] = {"max_gaussians": 1_000_000}
"""TrainingSettings of methods that have no budget of Gaussians: more than a handful of photographs makes."""

VANILLA_3DGS: Mapping[str, Any] = {
    **EVERY_PIXEL,
    **UNREGULARISED,
    **UNBOUNDED,
    "first_gaussians": "spheres",
    "densification": "original",
    "learning_rate_annealing": 1.0,
    "scale_learning_rate": 0.005,
    "rotation_learning_rate": 1e-3,
    "colour_learning_rate": 2.5e-3,
    "opacity_learning_rate": 0.05,
    "densify_from_share": 500 / 30000,
    "densify_until_share": 0.5,
}
"""TrainingSettings of the original 3DGS (Kerbl et al. 2023), which has 30,000 steps.

What is counted in steps there keeps its number, what ends at a step its share of them.
"""

SPARSE_STABLE_SH3: Mapping[str, Any] = {**VANILLA_3DGS, "densification": "none"}
"""TrainingSettings of the paper's GaussGym condition, "sparse-stable SH3", of which it tells no more.

GaussGym trains nerfstudio's splatfacto, whose rates are the original's. Of few photographs, additions by
gradient and resets of opacity are what does not stay stable.
"""

MANY_PHOTOGRAPHS: Mapping[str, Any] = {
    **UNREGULARISED,
    "first_gaussians": "discs",
    "densification": "growth",
    "densify_until_share": 0.4,
    "every_third_pixel_share": 0.8,
    "every_second_pixel_share": 0.2,
    "learning_rate_annealing": 3.0,
    "scale_learning_rate": 0.04,
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
        "training.later_rounds_learning_rate_ratio": 1.0,
        "training.learning_rate_annealing": 3.0,
        "training.disc_stride_px": 3,
        "training.detailed_share": 1.0,
        "training.every_third_pixel_share": 0.6,
        "training.every_second_pixel_share": 0.4,
    },
}
"""Named sets of overrides; ``paper`` is the dataclasses' own defaults."""


def entries(settings: Settings = Settings()) -> Iterator[Field]:
    """Every setting with its dotted key and, as its default, its value in ``settings``, in their order."""
    for name, field in fields_of(type(settings)).items():
        value = getattr(settings, name)
        if not dataclasses.is_dataclass(value):
            yield dataclasses.replace(field, default=value)
            continue
        for inner, one in fields_of(type(value)).items():
            yield dataclasses.replace(one, key=f"{name}.{inner}", default=getattr(value, inner))


def differing(settings: Settings, base: Settings) -> dict[str, Field]:
    """Those of ``settings`` that have another value than in ``base``, by key."""
    pairs = zip(entries(settings), entries(base), strict=True)
    return {own.key: own for own, other in pairs if own.default != other.default}


@functools.cache
def _known() -> Mapping[str, Field]:
    return {entry.key: entry for entry in entries()}


@functools.cache
def former_keys() -> Mapping[str, str]:
    """The keys of settings that once had another name, by that name."""
    renamed = (entry for entry in entries() if entry.formerly)
    return {f"{entry.key.rpartition('.')[0]}.{entry.formerly}": entry.key for entry in renamed}


def present_keys(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The overrides by the keys that settings have now; files of earlier versions give former ones."""
    return {former_keys().get(key, key): value for key, value in overrides.items()}


def by_dotted_keys(overrides: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """The settings by their keys, of which TOML makes tables where a person writes them without quotes."""
    found: dict[str, Any] = {}
    for key, value in overrides.items():
        is_table = isinstance(value, Mapping)
        found |= by_dotted_keys(value, f"{prefix}{key}.") if is_table else {f"{prefix}{key}": value}
    return found


def of_captures(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Those settings that an import is made with."""
    return {key: value for key, value in overrides.items() if key.startswith("captures.")}


def with_overrides(overrides: Mapping[str, Any], base: Settings = Settings()) -> Settings:
    """``base`` with dotted keys replaced; values may be strings from a command line.

    Raises SettingsError naming the key, the closest known key, or the allowed range.
    """
    known = _known()
    reader = Reader(Path("settings"), "setting", SettingsError)
    sections: dict[str, dict[str, Any]] = {}
    for key, raw in present_keys(overrides).items():
        if key not in known:
            cure = did_you_mean(key, known, "See docs/settings.md.")
            raise SettingsError(f"there is no setting '{key}'", where="settings", cure=cure)
        section, _, name = key.rpartition(".")
        sections.setdefault(section, {})[name] = reader.value(known[key], _number(known[key], raw))
    # Each section at once: what its settings must keep to together holds at the end only.
    changed = sections.pop("", {})
    changed |= {name: dataclasses.replace(getattr(base, name), **new) for name, new in sections.items()}
    return dataclasses.replace(base, **changed)


def preset(name: str) -> Settings:
    """The settings of a named preset. Raises SettingsError for an unknown name."""
    if name not in PRESETS:
        raise SettingsError(f"there is no preset '{name}'", where="settings", cure=f"Known: {', '.join(PRESETS)}.")
    return with_overrides(PRESETS[name])


def _number(entry: Field, raw: Any) -> Any:
    """The number that a text of the command line is, where the setting is one."""
    if entry.kind in (int, float) and isinstance(raw, str):
        with contextlib.suppress(ValueError):
            return entry.kind(raw)
    return raw
