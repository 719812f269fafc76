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
_PACKAGE, _PACKAGE_FILE = "package://", "package.xml"
_NAME = re.compile(rb"<name>\s*([A-Za-z0-9_.-]+)\s*</name>")
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
    ``mjcf/``, ``xml/`` or ``robots/`` the folder above; and the ROS package around it, where
    there is one: the nearest folder above with a ``package.xml``.
    """

    main: Path
    root: Path
    _read_bytes: int = field(default=0)
    _packages: dict[Path, str] | None = field(default=None)

    @staticmethod
    def of(path: Path) -> RobotFolder:
        """The folder of the robot's file ``path``. Raises RobotError for a name that no file can have."""
        try:
            path = path.resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a null character, links in a circle
            raise RobotError(f"this is no file's name: {error}", where=path, cure="Give an MJCF or a URDF.") from error
        is_package = path.parent.name.lower() in _PACKAGE_FOLDERS
        root = path.parent.parent if is_package else path.parent
        return RobotFolder(path, next((place for place in (root, *root.parents) if _is_package(place)), root))

    def find(self, name: str, bases: Sequence[Path], at: str) -> Path:
        """The file ``name`` in the first of the folders ``bases`` that has it, without links.

        ``package://package/name`` is looked for in the folders above that have a ``package.xml`` with
        that name or are called so, else in the robot's own. Raises RobotError, with ``at`` as the place, for an
        absolute name, an address, one outside ``root`` even by a link, and one that is no file.
        """
        inside = None
        if name.startswith(_PACKAGE):
            package, _, name = name.removeprefix(_PACKAGE).lstrip("/").partition("/")
            bases = inside = [*self._named(package), self._own]
        places = self.places(name, bases, at, inside)
        if found := next((place for place in places if place.is_file()), None):
            return found
        looked = ", ".join(dict.fromkeys(str(base) for base in inside or [self.root]))
        raise RobotError(f"there is no file '{name}'", where=at, cure=f"It is looked for in {looked}; put it there.")

    def places(self, name: str, bases: Sequence[Path], at: str, inside: Sequence[Path] | None = None) -> list[Path]:
        """Those of ``base / name`` without links that are inside ``root``, or each in its one of the
        folders ``inside``; they need not exist. Raises as ``find`` does where there is none."""
        check_relative(name, at)
        found, refused = [], None
        for base, root in zip(bases, inside or [self.root] * len(bases), strict=True):
            try:
                found.append(_inside(root, base / name, name, at))
            except (OSError, RuntimeError) as error:  # a name too long, links in a circle
                raise RobotError(f"'{name}' cannot be looked for: {error}", where=at, cure=_INSIDE) from error
            except RobotError as error:
                refused = refused or error
        if refused and not found:
            raise refused
        return found

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

    @property
    def _own(self) -> Path:
        """The folder of the robot's file, or the one above, whatever package it is in."""
        parent = self.main.parent
        return parent.parent if parent.name.lower() in _PACKAGE_FOLDERS else parent

    def _named(self, package: str) -> list[Path]:
        """The folders above that are the ROS package of that name: by their ``package.xml``, then, as an
        installed one may be named after its folder alone, by that."""
        if self._packages is None:
            self._packages = {place: self._package_name(place) for place in self.main.parents if _is_package(place)}
        named = [place for place, name in self._packages.items() if name == package]
        return [*named, *(place for place in self._packages if place.name == package)]

    def _package_name(self, place: Path) -> str:
        """The name in the folder's ``package.xml``; '' where that cannot be read."""
        try:
            file = place / _PACKAGE_FILE
            text, *commented = self.read(file, str(file)).split(b"<!--")
            name = _NAME.search(text + b"".join(part.partition(b"-->")[2] for part in commented))
        except RobotError:
            return ""
        return name[1].decode() if name else ""


def _is_package(place: Path) -> bool:
    try:
        return (place / _PACKAGE_FILE).is_file()
    except OSError:
        return False


def _inside(root: Path, path: Path, name: str, at: str) -> Path:
    """``path`` without links. What is written is checked before any link is followed."""
    written = Path(os.path.normpath(path))
    for place in (written, written.resolve() if written.is_relative_to(root) else written):
        if not place.is_relative_to(root):
            raise RobotError(f"'{name}' leaves the robot's folder {root}", where=at, cure=_INSIDE)
    return place
