"""Folders on storage that several machines reach by a URL, such as S3's: published whole, fetched whole.

What a file holds lies at ``URL/files/`` by its SHA-256, once for all that hold it; which files a folder has stands in
``URL/NAME.json``, which is written last. So a folder is there whole or not at all, and what is interrupted goes on.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Any, NoReturn

from ..core.atomic_files import UNFINISHED, remove, rename
from ..core.digests import content_digest
from ..core.errors import ExperimentError, MachineError, may_not_be_read
from ..core.json_files import parse_json

PROTOCOLS = ("file", "s3")
"""Those that are tested; fsspec has more."""

_MARK = ".stored.json"  # in a folder that was fetched: its list
_CHUNK_BYTES = 1 << 20
_LONGEST_LIST = 64 << 20
_UNREACHABLE = "Can this machine reach it, and with which rights? See docs/experiments.md."

Wanted = Callable[[str], bool]
"""Whether a file of this name, relative and with /, is wanted."""


def _all(_name: str) -> bool:
    return True


@dataclass(frozen=True)
class ObjectStore:
    """The storage at ``url``: "s3://bucket/prefix", or "file:///folder" on a disk that all see."""

    url: str

    @staticmethod
    def at(url: str) -> ObjectStore:
        """Raises ExperimentError for a URL of another kind, MachineError without what speaks to it."""
        protocol, _, rest = url.partition("://")
        if protocol not in PROTOCOLS or not rest.strip("/"):
            cure = "Give s3://bucket/prefix, or file:///folder."
            raise ExperimentError("this is no storage for experiments", where=url, cure=cure)
        try:
            store = ObjectStore(url.rstrip("/"))
            _ = store._root
        except ImportError as error:
            raise MachineError(
                "storage needs packages of the cluster", where=url, cure="`make install CLUSTER=1`."
            ) from error
        return store

    def has(self, name: str) -> bool:
        """Whether a folder of this name was published. Raises ExperimentError where nothing answers."""
        try:
            return bool(self._files.exists(f"{self._root}/{name}.json"))
        except Exception as error:
            raise self._failed(name, error) from error

    def publish(self, folder: Path, name: str) -> None:
        """Put a folder there, all its files but hidden ones, and what its links lead to in their places.

        Raises ExperimentError, also for a link that leads nowhere, or around.
        """
        files, folders = dict[str, tuple[str, int]](), list[str]()
        for where, is_empty, names in _shown(folder):
            if is_empty:
                folders.append(where.relative_to(folder).as_posix())
            for one in names:
                file = where / one
                files[file.relative_to(folder).as_posix()] = content_digest(file), file.stat().st_size
        try:
            for relative, (digest, size) in files.items():
                if self._size(self._place(digest)) != size:
                    with (folder / relative).open("rb") as source:
                        self._put(source, self._place(digest))
            listed = json.dumps({"files": files, "folders": folders}, indent=1, sort_keys=True)
            self._put(io.BytesIO(listed.encode()), f"{self._root}/{name}.json")
        except Exception as error:
            raise self._failed(name, error) from error

    def fetch(self, name: str, folder: Path, wanted: Wanted = _all) -> bool:
        """Make ``folder`` hold what was published, in place of what it held; False where nothing was.

        With ``wanted`` those files alone. A folder that holds it already is left as it is. Raises ExperimentError for
        a list or a file that is damaged.
        """
        try:
            with self._files.open(f"{self._root}/{name}.json", "rb") as source:
                listed = source.read(_LONGEST_LIST)
        except FileNotFoundError:
            return False
        except Exception as error:
            raise self._failed(name, error) from error
        if (folder / _MARK).is_file() and (folder / _MARK).read_bytes() == listed:
            return True
        staging = folder.with_name(UNFINISHED + folder.name)
        remove(staging)
        staging.mkdir(parents=True)
        try:
            for relative, digest, size in self._listed(name, listed, staging):
                if wanted(relative.as_posix()):
                    self._get(name, relative, digest, size, staging)
            (staging / _MARK).write_bytes(listed)
            remove(folder)
            rename(staging, folder)
        finally:
            remove(staging)
        return True

    def _listed(self, name: str, listed: bytes, staging: Path) -> Iterator[tuple[PurePosixPath, str, int]]:
        """The files of a list; empty folders are made."""
        try:
            told = parse_json(listed.decode())
            files = [(_inside(one), str(digest), int(size)) for one, (digest, size) in told["files"].items()]
            folders = [_inside(one) for one in told["folders"]]
            if any(len(digest) != 64 or not digest.isalnum() for _, digest, _ in files):
                raise ValueError("a digest is none")
            for one in folders:
                (staging / one).mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise self._damaged(name, str(error)) from error
        yield from files

    def _get(self, name: str, relative: PurePosixPath, digest: str, size: int, staging: Path) -> None:
        file = staging / relative
        found, left = hashlib.sha256(), size
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with self._files.open(self._place(digest), "rb") as source, file.open("wb") as place:
                while left >= 0 and (chunk := source.read(min(_CHUNK_BYTES, left + 1))):
                    found.update(chunk)
                    place.write(chunk)
                    left -= len(chunk)
        except FileNotFoundError as error:
            raise self._damaged(name, f"{relative} is missing") from error
        except Exception as error:
            raise self._failed(name, error) from error
        if left or found.hexdigest() != digest:
            raise self._damaged(name, f"{relative} is not what was published")

    def _put(self, source: IO[bytes], place: str) -> None:
        """A file that nobody sees before it is whole, whoever else puts it there."""
        if self.url.startswith("file:"):
            unfinished = f"{place}.{secrets.token_hex(8)}"
            with self._files.open(unfinished, "wb") as target:
                shutil.copyfileobj(source, target, _CHUNK_BYTES)
            self._files.mv(unfinished, place)
            return
        target = self._files.open(place, "wb", autocommit=False)
        try:
            shutil.copyfileobj(source, target, _CHUNK_BYTES)
            target.close()
        except BaseException:
            target.discard()
            raise
        target.commit()

    def _size(self, place: str) -> int:
        """Of a file there, bytes; -1 for none."""
        try:
            return int(self._files.size(place))
        except FileNotFoundError:
            return -1

    def _place(self, digest: str) -> str:
        return f"{self._root}/files/{digest[:2]}/{digest}"

    @cached_property
    def _opened(self) -> tuple[Any, str]:
        import fsspec

        options = {"auto_mkdir": True} if self.url.startswith("file:") else {}
        files, root = fsspec.core.url_to_fs(self.url, use_listings_cache=False, **options)
        return files, str(root).rstrip("/")

    @property
    def _files(self) -> Any:
        return self._opened[0]

    @property
    def _root(self) -> str:
        return self._opened[1]

    def _failed(self, name: str, error: Exception) -> ExperimentError:
        what = f"the storage cannot be used: {type(error).__name__}: {error}"
        return ExperimentError(what, where=f"{self.url}/{name}", cure=_UNREACHABLE)

    def _damaged(self, name: str, why: str) -> ExperimentError:
        cure = "Remove its .json there: it is made again."
        return ExperimentError(f"this folder is damaged: {why}", where=f"{self.url}/{name}", cure=cure)


def _shown(folder: Path) -> Iterator[tuple[Path, bool, list[str]]]:
    """Each folder that is not hidden, linked ones too, whether it is empty, and its files. Raises ExperimentError."""
    for place, inside, names in os.walk(folder, onerror=_raise, followlinks=True):
        where = Path(place)
        inside[:] = sorted(one for one in inside if not one.startswith("."))
        shown = sorted(one for one in names if not one.startswith("."))
        above = {one.resolve() for one in (where, *where.parents)}
        for one in inside:
            if (where / one).resolve() in above:
                raise _wrong(where / one, "leads back to a folder that it lies in")
        for one in shown:
            if not (where / one).is_file():
                raise _wrong(where / one, "is no file, and leads to none")
        yield where, not inside and not shown, shown


def _wrong(place: Path, why: str) -> ExperimentError:
    return ExperimentError(f"this {why}", where=place, cure="Replace it by what it should lead to, or remove it.")


def _raise(error: OSError) -> NoReturn:
    raise may_not_be_read(error.filename, ExperimentError) from error


def _inside(name: str) -> PurePosixPath:
    """A relative path that stays within. Raises ValueError."""
    path = PurePosixPath(name)
    if path.is_absolute() or "\\" in name or PureWindowsPath(name).drive or ".." in path.parts:
        raise ValueError(f"{name!r:.80} leaves its folder")
    return path
