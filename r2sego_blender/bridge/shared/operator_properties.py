"""An operator's properties as JSON values, so that it can be called again with the same."""

from __future__ import annotations

from typing import Any

import bpy

_PLAIN = (bool, int, float, str)


def given_properties(operator: bpy.types.Operator) -> dict[str, Any]:
    """The properties that were set, now or when it was last called, names of files made absolute.

    Collections are left out.
    """
    given = {}
    for prop in operator.properties.rna_type.properties:
        name = prop.identifier
        if name == "rna_type" or prop.is_readonly:
            continue
        if not operator.properties.is_property_set(name, ghost=False):
            continue
        value = getattr(operator, name)
        if isinstance(value, str) and value.startswith("//"):  # beside the .blend of now
            given[name] = bpy.path.abspath(value)
        elif isinstance(value, _PLAIN):
            given[name] = value
        elif isinstance(value, set):
            given[name] = sorted(value)
        elif getattr(prop, "is_array", False):
            given[name] = list(value)
    return given


def as_arguments(operator: bpy.types.Operator, given: dict[str, Any]) -> dict[str, Any]:
    """What ``given_properties`` returned, as arguments for the operator's ``bpy.ops``; unknown ones go."""
    known = operator.get_rna_type().properties
    return {
        name: set(value) if getattr(known[name], "is_enum_flag", False) else value
        for name, value in given.items()
        if name in known
    }
