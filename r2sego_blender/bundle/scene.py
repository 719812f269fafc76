"""The scene bundle on disk: declared in ``scene.toml``, filled step by step, never half-written.

A step of Algorithm 1 publishes one file or folder. It runs again only when the content of
its inputs, its parameters or the library's version changed, or its result was damaged;
``journal.jsonl`` remembers the digests. Results are written beside their place, flushed and
renamed, so a cut-off run leaves the bundle as it was. This module needs NumPy at most, so
Blender's Python reads bundles with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import hashlib
import json
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..config.fields import in_keys
from ..core.atomic_files import (
    UNFINISHED,
    finish_replacing,
    flush,
    remove,
    rename,
    replacing_together,
    swap_in,
)
from ..core.digests import content_digest
from ..core.errors import SceneError
from ..core.file_locks import try_lock
from ..core.scratch import keeping, scratch_place
from .backends import controller_backend
from .declaration import DECLARATION, Declaration, name_in, read_declaration, write_declaration
from .frames import frame_of_output
from .journal import Journal
from .layout import COLLISION, REFINED_ASSET

_LOCK = ".lock"
_HOLDERS: dict[Path, int] = {}  # of bundles that this process holds: the thread


class Scene:
    """A bundle that exists; get one from ``Scene.create`` or ``Scene.open``."""

    def __init__(self, path: Path, declaration: Declaration) -> None:
        self.path = path
        self.declaration = declaration
        self._journal = Journal(path)

    # ---- opening

    @staticmethod
    def create(path: Path, declaration: Declaration, fill: Callable[[Path], None]) -> Scene:
        """Make a bundle: ``fill`` writes its captures into the folder it is given.

        Raises SceneError when ``path`` exists; nothing is left behind when ``fill`` fails.
        """
        path = Path(path)
        require_place(path)
        staging = path.with_name(f"{UNFINISHED}{path.name}-{os.getpid()}")
        missing = [folder for folder in path.absolute().parents if not folder.exists()]
        with _disk_errors(path, kept=""), scratch_place(staging):
            _remove_abandoned(path.parent)
            shutil.rmtree(staging, ignore_errors=True)
            staging.mkdir(parents=True)
            try:
                with (staging / _LOCK).open("a+") as file:
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

    @staticmethod
    def open(path: Path) -> Scene:
        """Read a bundle. Raises SceneError when it is missing, damaged or of another version."""
        path = Path(path)
        return Scene(path, read_declaration(path))

    def declare(self, **changes: Any) -> Scene:
        """This scene with parts of its declaration changed, on disk too.

        The other parts are as they stand there now: another may have changed them since it was opened.
        """
        present = self._declaration_now()
        declaration = dataclasses.replace(present, **changes)
        _ = declaration.settings  # refuse unknown settings before anything is written
        if declaration != present:
            with _disk_errors(self.path):
                write_declaration(self.path / DECLARATION, declaration)
        return Scene(self.path, declaration)

    def _declaration_now(self) -> Declaration:
        """As it stands on disk; one that ``changing_together`` made has none there yet."""
        there = (self.path / DECLARATION).is_file()
        return read_declaration(self.path) if there else self.declaration

    # ---- places

    @property
    def name(self) -> str:
        """The folder's name, also of the folder that one stands in."""
        return os.path.basename(os.path.abspath(self.path))  # noqa: PTH100, PTH119  (a link keeps its name)

    def name_of(self, file: str) -> str:
        """How the bundle names ``file``: relative to itself where it lies inside, else as it is."""
        return name_in(self.path, file)

    @property
    def captures_folder(self) -> Path:
        """Photographs, cameras in the world frame and the sparse model."""
        return self.path / "captures"

    @property
    def geometry_folder(self) -> Path:
        """Depth maps, observed points with their support record, and room planes."""
        return self.path / "geometry"

    @property
    def collision_folder(self) -> Path:
        """The current collision surface."""
        return self.path / "collision"

    @property
    def report_folder(self) -> Path:
        """The report, its figures and ``metrics.json``."""
        return self.path / "report"

    @property
    def metrics_file(self) -> Path:
        """The scores that the last evaluation left, if there was one."""
        return self.report_folder / "metrics.json"

    @property
    def asset_file(self) -> Path:
        """The refined visual asset, an Inria PLY."""
        return self.path / "asset.ply"

    def round_folder(self, round_index: int) -> Path:
        """What one round of Algorithm 1 left."""
        return self.path / "rounds" / str(round_index)

    def rounds_done(self) -> int:
        """How many rounds have ended with a visual asset."""
        done = 0
        while (self.round_folder(done) / "asset.ply").is_file():
            done += 1
        return done

    def rounds_of_result(self) -> int:
        """How many rounds the result stands on: those done, but none beyond the declared ones."""
        return min(self.rounds_done(), self.declaration.settings.rounds)

    def newest_round(self, made: str) -> int:
        """The last declared round that holds ``made``, such as "views"; -1 where none does.

        Rounds beyond the declared ones may be of anything that was there before.
        """
        declared = reversed(range(self.declaration.settings.rounds))
        return next((index for index in declared if (self.round_folder(index) / made).exists()), -1)

    # ---- steps

    def step(
        self,
        target: str,
        compute: Callable[[Path], None],
        *,
        inputs: Sequence[str | Path] = (),
        parameters: Any = None,
        read: Callable[[], object] | None = None,
    ) -> Path:
        """Make ``target`` by ``compute`` unless it is there and nothing it reads has changed.

        ``target`` is a path inside the bundle, a file when it has a suffix, else a folder;
        ``compute`` writes it at the path it is given. ``inputs`` are files and folders,
        inside the bundle when relative; ``parameters`` are dataclasses or JSON values.
        ``read`` reads the result as later steps do: one that is not as it was published is
        kept as a person's edit where that succeeds. Without it any change is damage.
        """
        place = self.path / target
        digest = self._digest_of_inputs(inputs, parameters)
        before = self.recorded().get(target)
        if place.exists() and before == digest and not self.is_damaged(target, read):
            return place
        started, started_s = time.time(), time.monotonic()
        with _disk_errors(place), self.publishing(target) as staging:
            compute(staging)
            if before is not None:
                # Killed from here on, the old record is no longer true.
                self._journal.write(publishing=target)
        record = {
            "step": target, "inputs": digest, "output": content_digest(place),
            "started": round(started, 3), "seconds": round(time.monotonic() - started_s, 3),
            "frame": frame_of_output(
                self.declaration.world_from_capture, map(str, inputs), self.journal()
            ),
        }  # fmt: skip
        with _disk_errors(self.path):
            self._journal.write(**record)
        return place

    def is_damaged(self, target: str, read: Callable[[], object] | None = None) -> bool:
        """Whether a result is not what its step published and, where it can be edited, ``read`` fails.

        Of results that no journal noted nothing is said.
        """
        published = self.outputs().get(target)
        if published is None or self._digest_of_input(target) == published:
            return False
        if read is None:
            return True
        try:
            read()
        except Exception:  # whatever a reader raises, the steps after it cannot read it either
            return True
        return False

    def damaged_results(self) -> tuple[str, ...]:
        """The names of the scene's results that are no more what was published: cut off, or changed."""
        results = [name for name in (REFINED_ASSET, COLLISION) if (self.path / name).exists()]
        published = self.outputs()
        damaged = tuple(name for name in results if self.is_damaged(name))
        now = self.outputs()  # a result that is replaced meanwhile is not damaged
        return tuple(name for name in damaged if now.get(name) == published.get(name))

    def require_as_made(self, *results: str) -> None:
        """Raises SceneError where one of the ``results`` at the top is no more what was published."""
        for name in results:
            if self.is_damaged(name):
                raise SceneError(
                    "it is not as it was made: cut off, or changed", where=self.path / name,
                    cure=f"Keep a copy of what you changed; `r2sego refine {self.path}` makes it again.",
                )  # fmt: skip

    @contextlib.contextmanager
    def publishing(self, target: str) -> Iterator[Path]:
        """A path to write at; on leaving without an error it takes ``target``'s place.

        A cancelled process leaves nothing of it.
        """
        place = self.path / target
        place.parent.mkdir(parents=True, exist_ok=True)
        staging = place.with_name(UNFINISHED + place.name)
        remove(staging)
        if not place.suffix:
            staging.mkdir()
        try:
            with scratch_place(staging):
                yield staging
                flush(staging)
                with keeping(staging):
                    swap_in(staging, place)
        finally:
            remove(staging)

    @contextlib.contextmanager
    def changing_together(self, parts: Sequence[str]) -> Iterator[Scene]:
        """A scene without content to publish ``parts`` in, and to declare.

        On leaving without an error they all replace this one's. Killed on the way, none has, or
        the next who holds the lock puts the rest there.
        """
        with _disk_errors(self.path), replacing_together(self.path, (*parts, DECLARATION)) as folder:
            yield Scene(folder, self._declaration_now())

    @property
    def backends(self) -> dict[str, str]:
        """The backend of each slot: as declared, and the controller that drove the last rollouts."""
        return {**self.declaration.backends, **controller_backend(self.path)}

    def journal(self) -> list[dict[str, Any]]:
        """The records of every step run so far, oldest first."""
        return self._journal.steps()

    def recorded(self) -> dict[str, str]:
        """The digest of what each step read, by its target (``Journal.inputs``)."""
        return self._journal.inputs()

    def outputs(self) -> dict[str, str]:
        """The ``content_digest`` of each step's last result, by its target (``Journal.outputs``)."""
        return self._journal.outputs()

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the bundle for writing; the thread that holds it may do so again.

        Raises SceneError when another process or thread holds it, and after finishing what was cut off.
        """
        key, thread = self.path.resolve(), threading.get_ident()
        if _HOLDERS.get(key) == thread:
            yield
            return
        with _disk_errors(self.path, kept=""):
            lock = (self.path / _LOCK).open("a+")
        with lock as file:
            if not try_lock(file):
                raise SceneError(
                    "another process is working on this scene", where=self.path,
                    cure="Wait until it has ended, or cancel it.",
                )  # fmt: skip
            if finish_replacing(self.path):  # whoever holds the lock has read what was there before
                raise SceneError(
                    "a correction had been cut off, and is finished now", where=self.path, cure="Start again."
                )
            _HOLDERS[key] = thread
            try:
                yield
            finally:
                del _HOLDERS[key]

    def held_still(self) -> contextlib.AbstractContextManager[None]:
        """Keep others from writing while results that belong together are read; as ``locked``.

        A bundle that may only be read, as published ones, is read without its lock.
        """
        lock = self.path / _LOCK
        writable = os.access(lock if lock.exists() else self.path, os.W_OK)
        return self.locked() if writable else contextlib.nullcontext()

    def _digest_of_inputs(self, inputs: Sequence[str | Path], parameters: Any) -> str:
        state = {
            "version": __version__,
            "inputs": {str(item): self._digest_of_input(item) for item in inputs},
            "parameters": parameters,
        }
        text = json.dumps(state, sort_keys=True, default=_as_json)
        return hashlib.sha256(text.encode()).hexdigest()

    def _digest_of_input(self, item: str | Path) -> str:
        return content_digest(self.path / item)


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
            f"no scene can be written there: {error.strerror}", where=path,
            cure="Choose another folder, or allow writing.",
        ) from error  # fmt: skip


def _remove_abandoned(folder: Path) -> None:
    """Remove the unfinished bundles that processes left in ``folder`` when they were killed."""
    for file in folder.glob(f"{UNFINISHED}*/{_LOCK}"):
        with contextlib.suppress(OSError, SceneError):  # what cannot go disturbs nobody
            with file.open("a+") as lock:
                free = try_lock(lock)
            if free:
                remove(file.parent)


def _as_json(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return in_keys(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    return str(value)


@contextlib.contextmanager
def _disk_errors(place: Path, kept: str = ": finished steps are kept") -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES):
            raise
        reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "it cannot be written"
        raise SceneError(
            reason, where=place,
            cure=f"Make room, allow writing, or close what has it open, then start again{kept}.",
        ) from error  # fmt: skip
