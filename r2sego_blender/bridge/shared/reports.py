"""What an operator reported as an error, without the word that Blender puts before it."""

from __future__ import annotations

import bpy


def reported(error: RuntimeError, word: str | None = None) -> str:
    """The sentence of an operator's error. ``word`` is Blender's for it: that of the interface's language."""
    said = str(error).strip()
    words = (word or bpy.app.translations.pgettext_rpt("Error"), "Error")
    return next((said.removeprefix(f"{one}: ") for one in words if said.startswith(f"{one}: ")), said)
