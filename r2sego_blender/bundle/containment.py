"""Nothing of a bundle is read or written outside of it, whatever it holds.

A bundle may come from a stranger. A link in it that leads out would have a refinement read, overwrite
or clean up another's files; a pipe would hold it for ever. Neither is of a bundle, and one that has any
is refused before anything in it is opened. Needs the standard library alone.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path, PurePosixPath, PureWindowsPath

from ..core.errors import SceneError
from .layout import DECLARATION

_JUNCTION = getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", None)
"""What Windows has beside links."""


def require_contained(bundle: Path) -> None:
    """Raises SceneError where ``bundle`` has a link that leads out of it, or what is neither file nor folder.

    What comes and goes meanwhile, as a job has it, is passed over.
    """
    home = os.path.realpath(bundle)
    folders = [os.fspath(bundle)]
    while folders:
        folder = folders.pop()
        try:
            entries = list(os.scandir(folder))
        except OSError:  # gone meanwhile, or nobody's to read: then nothing in it is
            continue
        for entry in entries:
            if entry.is_symlink() or _is_junction(entry):
                if not _lies_in(os.path.realpath(entry.path), home):
                    raise _leads_out(entry.path)
            elif entry.is_dir(follow_symlinks=False):
                folders.append(entry.path)
            elif not entry.is_file(follow_symlinks=False) and os.path.lexists(entry.path):
                raise SceneError(
                    "this is neither a file nor a folder, and a bundle holds nothing else",
                    where=entry.path,
                    cure="Remove it.",
                )


def inside(bundle: Path, name: str) -> Path:
    """The place of ``name`` in ``bundle``, which lies in it whatever links are there.

    Raises SceneError for a name that is a whole path or climbs, and for one that a link leads out.
    """
    names = (PurePosixPath(name), PureWindowsPath(name))
    if "\0" in name or any(one.is_absolute() or one.drive or ".." in one.parts for one in names):
        raise SceneError("this is no name of something in the bundle", where=f"{bundle}: {name}", cure="Mend it.")
    place = bundle / name
    if not _lies_in(os.path.realpath(place), os.path.realpath(bundle)):
        raise _leads_out(place)
    return place


def require_outside(place: Path) -> None:
    """Raises SceneError where ``place`` is among what a bundle's steps read and publish.

    Hidden folders of a bundle are none of that: Blender has what it shows there.
    """
    resolved = place.resolve()
    for bundle in (resolved, *resolved.parents):
        if (bundle / DECLARATION).is_file():
            names = resolved.relative_to(bundle).parts
            if not names or not names[0].startswith("."):
                raise SceneError(
                    "this lies in a scene, which only its own steps write into",
                    where=place,
                    cure="Choose a place outside of the scene.",
                )


def make_folder(folder: Path, bundle: Path) -> None:
    """Make ``folder`` in ``bundle``, with those above it, but never the bundle. Raises OSError."""
    if folder != bundle and not folder.is_dir():
        make_folder(folder.parent, bundle)
        folder.mkdir(exist_ok=True)


def _lies_in(path: str, home: str) -> bool:
    return os.path.normcase(path) == os.path.normcase(home) or Path(path).is_relative_to(home)


def _is_junction(entry: os.DirEntry[str]) -> bool:
    if _JUNCTION is None:
        return False
    return bool(getattr(entry.stat(follow_symlinks=False), "st_reparse_tag", 0) == _JUNCTION)


def _leads_out(place: object) -> SceneError:
    return SceneError(
        "this is a link out of the bundle, and nothing outside of it is read or written",
        where=place,
        cure="Put what it links to in its place.",
    )
