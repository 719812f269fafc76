"""The one folder that a robot's file may name files of."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from ...core.errors import RobotError

_PACKAGE_FOLDERS = {"urdf", "mjcf", "xml", "robots"}
_LARGEST_FILE_BYTES, _LARGEST_ROBOT_BYTES = 128 << 20, 1 << 30
_ADDRESS = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]*:")
_PACKAGE = "package://"
_INSIDE = "Put it into the robot's folder and name it relative to the robot's file."


def check_relative(name: str, at: str) -> None:
    """Raise RobotError for an absolute name, an address, and one with characters no name needs."""
    if _ADDRESS.match(name) or PurePosixPath(name).is_absolute():
        raise RobotError(f"'{name}' is not relative to the robot's file", where=at, cure=_INSIDE)
    if "\\" in name or "\0" in name:
        raise RobotError(f"'{name}' is no file's name", where=at, cure="Write folders with '/'.")


@dataclass
class RobotFolder:
    """Finds and reads files inside ``root``, in all at most 1 GiB.

    ``main`` is the robot's file, without links. ``root`` is its folder; for a file in ``urdf/``,
    ``mjcf/``, ``xml/`` or ``robots/`` the folder above, as in a ROS package.
    """

    main: Path
    root: Path
    _read_bytes: int = field(default=0)

    @staticmethod
    def of(path: Path) -> RobotFolder:
        """The folder of the robot's file ``path``. Raises RobotError for a name that no file can have."""
        try:
            path = path.resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a null character, links in a circle
            raise RobotError(f"this is no file's name: {error}", where=path, cure="Give an MJCF or a URDF.") from error
        is_package = path.parent.name.lower() in _PACKAGE_FOLDERS
        return RobotFolder(path, path.parent.parent if is_package else path.parent)

    def find(self, name: str, bases: Sequence[Path], at: str) -> Path:
        """The file ``name`` in the first of the folders ``bases`` that has it, without links.

        ``package://package/name`` is looked for in ``root``. Raises RobotError, with ``at`` as
        the place, for an absolute name, an address, one outside ``root`` even by a link, and
        one that is no file.
        """
        if name.startswith(_PACKAGE):
            _, _, name = name.removeprefix(_PACKAGE).partition("/")
            bases = [self.root]
        for base in bases:
            place = self.check(name, base, at)
            if place.is_file():
                return place
        raise RobotError(f"there is no file '{name}'", where=at, cure=f"It is looked for in {self.root}; put it there.")

    def check(self, name: str, base: Path, at: str) -> Path:
        """``base / name`` without links, which need not exist; raises as ``find`` does otherwise."""
        check_relative(name, at)
        try:
            return self._inside(base / name, name, at)
        except (OSError, RuntimeError) as error:  # a name too long, links in a circle
            raise RobotError(f"'{name}' cannot be looked for: {error}", where=at, cure=_INSIDE) from error

    def read(self, path: Path, at: str) -> bytes:
        """The content of ``path``, found here. Raises RobotError: too large or no plain file."""
        flags = os.O_RDONLY
        for name in ("O_BINARY", "O_NOFOLLOW", "O_NONBLOCK"):
            flags |= getattr(os, name, 0)
        left = min(_LARGEST_FILE_BYTES, _LARGEST_ROBOT_BYTES - self._read_bytes)
        try:
            with os.fdopen(os.open(path, flags), "rb") as file:
                if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                    raise RobotError(f"'{path.name}' is no plain file", where=at, cure="Give a plain file.")
                content = file.read(left + 1)
        except OSError as error:
            raise RobotError(f"'{path.name}' cannot be read: {error}", where=at, cure="Check it.") from error
        if len(content) > left:
            raise RobotError(
                f"'{path.name}' has more than {left >> 20} MiB", where=at, cure="Simplify the robot's meshes."
            )
        self._read_bytes += len(content)
        return content

    def _inside(self, path: Path, name: str, at: str) -> Path:
        """``path`` without links. What is written is checked before any link is followed."""
        written = Path(os.path.normpath(path))
        for place in (written, written.resolve() if written.is_relative_to(self.root) else written):
            if not place.is_relative_to(self.root):
                raise RobotError(f"'{name}' leaves the robot's folder {self.root}", where=at, cure=_INSIDE)
        return place
