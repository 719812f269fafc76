"""Blender properties of declared fields: their defaults, ranges and docs are those of the dataclasses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy

from ...config.fields import Field


def declared_property(field: Field, name: str, **more: Any) -> Any:
    """A property of ``field`` called ``name``; ``more`` is said to Blender besides, or instead."""
    described = {"name": name, "description": field.doc.rstrip("."), "default": field.default} | more
    if isinstance(field.default, bool):
        return bpy.props.BoolProperty(**described)
    if isinstance(field.default, int):
        return bpy.props.IntProperty(**limits(field), **described)
    if isinstance(field.default, float):
        return bpy.props.FloatProperty(**{"precision": _decimals(field.default)} | limits(field) | described)
    if field.choices:
        return bpy.props.EnumProperty(**described, items=[(c, c.capitalize(), "") for c in field.choices])
    return bpy.props.StringProperty(**described)


def limits(field: Field, to: Callable[[float], float] = lambda value: value) -> dict[str, float]:
    """The ``min`` and ``max`` of a field, in the unit that ``to`` makes of its own."""
    named = (("min", field.low), ("max", field.high))
    return {word: to(limit) for word, limit in named if limit is not None}


def _decimals(default: float) -> int:
    """Decimals that show two digits of ``default``, at least three."""
    return max(3, 1 + math.ceil(-math.log10(default))) if default > 0.0 else 3
