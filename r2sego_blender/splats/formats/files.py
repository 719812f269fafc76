"""Reading a file whole, and writing one that appears whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from ...core.atomic_files import rename
from ...core.errors import AssetError, may_not_be_read
from ...core.scratch import scratch_place
from ...core.text_files import opened_file

_OTHER_VALUES = 11
"""Of a Gaussian beside its harmonics."""

_LEAST_ROOM = 32 << 20
_MOST_TIMES = 10
"""Bytes of an asset that any file may claim, and times its size that a larger one may."""


def content(path: Path, most: int = -1) -> bytes:
    """The first ``most`` bytes of a file, or all. Raises AssetError when there is none to read."""
    try:
        with opened_file(path) as file:
            data = file.read(most)
    except PermissionError as error:
        raise may_not_be_read(path, AssetError) from error
    except (OSError, ValueError) as error:
        raise AssetError("the splat file cannot be read", where=path, cure="Check the path.") from error
    if not data:
        raise AssetError("the file is empty", where=path, cure="Copy or export it again.")
    return data


def require_room(gaussians: int, coefficients: int, file_bytes: int, path: Path) -> None:
    """Raises AssetError where so many Gaussians take more memory than a file of so many bytes can mean.

    Where files are packed, or show a thing many times, few bytes may claim any number of Gaussians.
    ``coefficients`` are the harmonics' of a channel.
    """
    needed = gaussians * (_OTHER_VALUES + 3 * coefficients) * 4
    if needed > max(_LEAST_ROOM, _MOST_TIMES * file_bytes):
        raise AssetError(
            f"the file claims {gaussians} Gaussians of {needed} bytes and holds {file_bytes}: it is cut short, "
            "or repeats its splats too often",
            where=path,
            cure="Copy it again, or export one copy of them.",
        )


@contextlib.contextmanager
def publishing(path: Path) -> Iterator[Path]:
    """A path beside ``path`` to write at; on leaving without an error it takes its place.

    It ends in the same suffix, by which libraries choose a format. A cancelled process leaves
    neither. Raises AssetError when the disk refuses.
    """
    staging = path.with_name(f".unfinished-{os.getpid()}-{path.name}")
    try:
        if not path.parent.is_dir():  # which some libraries would make
            raise FileNotFoundError(errno.ENOENT, "there is no such folder")
        with scratch_place(staging):
            yield staging
            with staging.open("rb+") as file:
                os.fsync(file.fileno())
            rename(staging, path)
    except OSError as error:
        raise AssetError(
            f"the file cannot be written: {error.strerror or error}",
            where=path,
            cure="Check that the folder is there, can be written and has room.",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            staging.unlink(missing_ok=True)
