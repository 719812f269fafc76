"""Every setting of the library as a Blender property: name, default, range and doc from settings.py."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import bpy

from ..settings import Entry, Settings, entries, preset


def property_name(key: str) -> str:
    """The property of a dotted key: ``selection.target_views`` is ``selection__target_views``."""
    return key.replace(".", "__")


def sections() -> dict[str, list[str]]:
    """The dotted keys by section, in the order of settings.py; top-level keys under ''."""
    grouped: dict[str, list[str]] = {}
    for entry in entries():
        section = entry.key.rpartition(".")[0]
        grouped.setdefault(section, []).append(entry.key)
    return grouped


def settings_group() -> type[bpy.types.PropertyGroup]:
    """A new PropertyGroup class with one property a setting."""
    annotations = {property_name(entry.key): _property(entry) for entry in entries()}
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
            changed[entry.key] = getattr(group, property_name(entry.key))
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


def _property(entry: Entry) -> Any:
    label = entry.key.rpartition(".")[2].replace("_", " ").capitalize()
    described = {"name": label, "description": entry.doc.rstrip("."), "default": entry.default}
    ranged = {key: value for key, value in (("min", entry.low), ("max", entry.high)) if value is not None}
    if isinstance(entry.default, bool):
        return bpy.props.BoolProperty(**described)
    if isinstance(entry.default, int):
        return bpy.props.IntProperty(**described, **ranged)
    if isinstance(entry.default, float):
        return bpy.props.FloatProperty(**described, **ranged, precision=3)
    if entry.choices:
        return bpy.props.EnumProperty(**described, items=[(c, c.capitalize(), "") for c in entry.choices])
    return bpy.props.StringProperty(**described)
