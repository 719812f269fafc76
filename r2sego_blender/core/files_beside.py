"""Files that another file names: beside it or below, and nowhere else.

A buffer's or a stage's name comes from whoever made the file. One that leads elsewhere, by its text or by
a link, would bring what lies there into what this program makes. Needs the standard library alone.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath


def file_beside(file: Path, name: str) -> Path:
    """The file that ``file`` calls ``name``, a relative path with forward slashes.

    Raises ValueError for an absolute path, an address, one that leads up, and for a link out of
    ``file``'s folder.
    """
    path = PurePosixPath(name)
    if not path.parts or path.is_absolute() or ".." in path.parts or not set(name).isdisjoint(":\\\0`"):
        raise ValueError(f"'{name}' is not beside the file")
    found = file.parent / path
    try:
        inside = found.resolve().is_relative_to(file.parent.resolve())
    except (OSError, RuntimeError) as error:  # a link that leads to itself
        raise ValueError(f"'{name}' leads nowhere") from error
    if not inside:
        raise ValueError(f"'{name}' is a link out of the file's folder")
    return found
