"""A new bundle: there whole, or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ..core.atomic_files import UNFINISHED, flush, remove, rename
from ..core.errors import SceneError
from ..core.file_locks import try_lock
from ..core.scratch import keeping, scratch_place
from .declaration import Declaration, write_declaration
from .disk import disk_errors
from .layout import DECLARATION
from .locks import LOCK
from .scene import Scene


def create_bundle(path: Path, declaration: Declaration, fill: Callable[[Path], None]) -> Scene:
    """Make a bundle: ``fill`` writes its captures into the folder it is given.

    Raises SceneError when ``path`` exists; nothing is left behind when ``fill`` fails.
    """
    path = Path(path)
    require_place(path)
    staging = path.with_name(f"{UNFINISHED}{path.name}-{os.getpid()}")
    missing = [folder for folder in path.absolute().parents if not folder.exists()]
    with disk_errors(path, kept=""), scratch_place(staging):
        _remove_abandoned(path.parent)
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir(parents=True)
        try:
            with (staging / LOCK).open("a+") as file:
                try_lock(file)  # so that others see that it is being made
                fill(staging)
                write_declaration(staging / DECLARATION, declaration)
                flush(staging)
            require_place(path)  # another may have made it meanwhile
            with keeping(staging):
                rename(staging, path)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
            for folder in missing:
                with contextlib.suppress(OSError):  # it holds the bundle, or what another put there
                    folder.rmdir()
    return Scene(path, declaration)


def require_place(path: Path) -> None:
    """Raises SceneError where a new bundle ``path`` cannot be: something is there, or nothing can be written.

    Leaves nothing behind.
    """
    if path.exists() or path.is_symlink():
        raise SceneError("it exists already", where=path, cure="Choose another name, or remove it.")
    try:
        folder = next(place for place in path.absolute().parents if place.exists())
        with tempfile.TemporaryDirectory(prefix=UNFINISHED, dir=folder):
            pass
    except OSError as error:
        raise SceneError(
            f"no scene can be written there: {error.strerror}",
            where=path,
            cure="Choose another folder, or allow writing.",
        ) from error


def _remove_abandoned(folder: Path) -> None:
    """Remove the unfinished bundles that processes left in ``folder`` when they were killed."""
    for file in folder.glob(f"{UNFINISHED}*/{LOCK}"):
        if file.is_symlink() or file.parent.is_symlink():  # nobody's unfinished bundle
            continue
        with contextlib.suppress(OSError, SceneError):  # what cannot go disturbs nobody
            with file.open("a+") as lock:
                free = try_lock(lock)
            if free:
                remove(file.parent)
