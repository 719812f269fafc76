"""A bundle that moved together with the .blend that shows it is found again beside it.

What a .blend holds of a bundle names it by the whole path, on objects, collections and masks
(``BUNDLE_MARK``) and in pictures' files; moved, all of them are turned to the new place.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import bpy

BUNDLE_MARK = "r2sego_bundle"
"""The custom property with the path of the bundle that an object, a collection or a mask belongs to."""


def whole_path(written: str) -> str:
    """A bundle's whole path as ``Bundle`` has it, however a property writes it: from the .blend, or with
    a slash at its end. '' stays '', and so does a path of another system, from which the .blend came."""
    if not written or _is_foreign(written):
        return written
    path = bpy.path.abspath(written)
    return _written_plainly(path) if path.startswith(os.sep) else str(Path(path).absolute())


@lru_cache(maxsize=64)  # panels and overlays ask at each redraw
def _written_plainly(path: str) -> str:
    return str(Path(path))


def way_from(blend: str, bundle: str) -> str:
    """The relative path from a .blend's folder to a bundle, for any system; '' where there is none (two
    drives)."""
    try:
        return Path(os.path.relpath(bundle, Path(blend).parent)).as_posix()
    except ValueError:
        return ""


def found_again(blend: str, bundle: str, way: str) -> Path | None:
    """Where a bundle is that is no longer at ``bundle``, and was at ``way`` when ``blend`` was saved.

    None where it never moved, or is not there either.
    """
    if not (blend and way) or Path(bundle).is_dir():
        return None
    place = Path(os.path.normpath(Path(blend).parent / way))
    return place if place.is_dir() else None


def turn_to(now: Path, before: str) -> None:
    """All that this file holds of the bundle at ``before`` is of the one at ``now`` from here on."""
    for block in (*bpy.data.objects, *bpy.data.collections, *bpy.data.images):
        if block.get(BUNDLE_MARK) == before:
            block[BUNDLE_MARK] = str(now)
    theirs = PurePosixPath if os.name == "nt" else PureWindowsPath
    kind = theirs if _is_foreign(before) else PurePath
    for image in bpy.data.images:
        file = kind(bpy.path.abspath(image.filepath))
        if image.filepath and file.is_relative_to(before):
            image.filepath = str(now.joinpath(*file.relative_to(before).parts))  # Blender reads it from there


def _is_foreign(path: str) -> bool:
    """Whether a path is Windows' and this system is not, or the other way round."""
    if os.name == "nt":
        return path.startswith("/") and not path.startswith("//")  # which means: from the .blend
    return path[1:3] == ":\\" or path.startswith("\\\\")
