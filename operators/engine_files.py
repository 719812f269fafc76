"""Files that Blender hands to the engine: in Blender's temporary folder, gone with it."""

import tempfile
from pathlib import Path

import bpy

from ..r2sego_blender.core.errors import SceneError


def handed_over(name: str) -> Path:
    """A path for a file, or a folder made by the caller, in a fresh folder of its own.

    Nobody else knows the folder, and the engine starts when the file is whole. Raises SceneError
    when the temporary folder cannot be written.
    """
    try:
        folder = tempfile.mkdtemp(prefix="r2sego-", dir=bpy.app.tempdir or None)
    except OSError as error:
        raise _not_written(bpy.app.tempdir, error) from error
    return Path(folder) / name


def hand_over(name: str, text: str) -> Path:
    """A file of that text for the engine. Raises SceneError when it cannot be written."""
    file = handed_over(name)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise _not_written(file, error) from error
    return file


def _not_written(where: Path | str, error: OSError) -> SceneError:
    return SceneError(
        f"what the engine needs cannot be written: {error.strerror}",
        where=where,
        cure="Make room there, or choose another temporary folder in Blender's preferences.",
    )
