"""Every setting of the library as a Blender property: name, default, range and doc from settings.py."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import bpy

from ...config.fields import Field
from ...config.presets import differing, entries, preset
from ...config.settings import Settings
from ..shared.declared_properties import declared_property

_UNITS = {"m": "m", "m2": "m²", "px": "px", "deg": "deg", "s": "s", "mb": "MB", "n": "N", "nm": "N m"}
_ABBREVIATIONS = {"sh": "SH", "ssim": "SSIM", "iou": "IoU", "nms": "NMS", "coacd": "CoACD"}
_SMALL_WORDS = frozenset({"a", "at", "by", "for", "from", "in", "of", "on", "per", "to", "until"})


def property_name(key: str) -> str:
    """The property of a dotted key: ``selection.target_views`` is ``selection__target_views``."""
    return key.replace(".", "__")


def label(key: str) -> str:
    """What people call the setting of a dotted key: ``registration.min_spread_px`` is Min Spread (px)."""
    words = key.rpartition(".")[2].split("_")
    unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
    named = [_ABBREVIATIONS.get(word, word.capitalize()) for word in (words[:-1] if unit else words)]
    small = [word.lower() if word.lower() in _SMALL_WORDS else word for word in named[1:]]
    name = " ".join([named[0], *small]).replace("Learning Rate", "LR")  # it stands beside its number
    return name + (f" ({unit})" if unit else "")


@functools.cache
def sections() -> dict[str, list[str]]:
    """The dotted keys by section, in the order of settings.py; top-level keys under ''.

    Made once: the panel asks at each redraw.
    """
    grouped: dict[str, list[str]] = {}
    for entry in entries():
        section = entry.key.rpartition(".")[0]
        grouped.setdefault(section, []).append(entry.key)
    return grouped


@functools.cache
def preset_values(preset_name: str) -> dict[str, str]:
    """What a preset sets otherwise than the fields show by default, by dotted key, as they would show it.

    Made once: the panel asks at each redraw.
    """
    return {key: _shown(entry) for key, entry in differing(preset(preset_name), Settings()).items()}


def settings_group() -> type[bpy.types.PropertyGroup]:
    """A new PropertyGroup class with one property a setting."""
    annotations = {property_name(entry.key): declared_property(entry, label(entry.key)) for entry in entries()}
    return type("R2SEGO_PG_settings", (bpy.types.PropertyGroup,), {"__annotations__": annotations})


def overrides(
    group: bpy.types.PropertyGroup, preset_name: str, declared: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, Any]:
    """What to override the preset with, by dotted key: the settings the person has set.

    A ``declared`` override that the person has unset again gets the preset's own value.
    """
    changed = {}
    for entry in entries(preset(preset_name)):
        if group.is_property_set(property_name(entry.key)):
            value = getattr(group, property_name(entry.key))
            # Blender's numbers have 32 bits: 0.005 comes back as 0.004999999888, out of its own range.
            changed[entry.key] = float(f"{value:.6g}") if isinstance(value, float) else value
        elif entry.key in declared:
            changed[entry.key] = entry.default
    return changed


def show_settings(group: bpy.types.PropertyGroup, changed: Mapping[str, Any], settings: Settings) -> None:
    """Set exactly the ``changed`` keys, to their values in ``settings``; unset all others."""
    for entry in entries(settings):
        name = property_name(entry.key)
        group.property_unset(name)
        if entry.key in changed:
            setattr(group, name, entry.default)


def _shown(entry: Field) -> str:
    if isinstance(entry.default, float):
        return f"{entry.default:g}"
    return entry.default.capitalize() if entry.choices else str(entry.default)
