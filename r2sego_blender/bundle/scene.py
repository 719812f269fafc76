"""The scene bundle: a folder with what a person declared, and what the steps of Algorithm 1 left in it.

``runner`` fills it, ``creating`` makes a new one. NumPy at most is needed, so Blender's Python reads
bundles with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..core.atomic_files import UNFINISHED, flush, remove, replacing_together, swap_in
from ..core.scratch import keeping, scratch_place
from . import locks
from .artifacts import Artifact, Held
from .backends import controller_backend, layout_backend
from .containment import inside, make_folder, require_contained
from .declaration import Declaration, name_in, read_declaration, write_declaration
from .disk import disk_errors
from .journal import Journal
from .layout import DECLARATION


class Scene:
    """A bundle that exists; get one from ``Scene.open`` or ``create_bundle``."""

    def __init__(self, path: Path, declaration: Declaration) -> None:
        self.path = path
        self.declaration = declaration
        self._journal = Journal(path)

    # ---- opening

    @staticmethod
    def open(path: Path) -> Scene:
        """Read a bundle. Raises SceneError when it is missing, damaged or of another version."""
        path = Path(path)
        require_contained(path)
        return Scene(path, read_declaration(path))

    def declare(self, **changes: Any) -> Scene:
        """This scene with parts of its declaration changed, on disk too.

        The other parts are as they stand there now: another may have changed them since it was opened.
        """
        present = self._declaration_now()
        declaration = dataclasses.replace(present, **changes)
        _ = declaration.settings  # refuse unknown settings before anything is written
        if declaration != present:
            locks.require_there(self.path)
            with disk_errors(self.path):
                write_declaration(self.path / DECLARATION, declaration)
        return Scene(self.path, declaration)

    def _declaration_now(self) -> Declaration:
        """As it stands on disk; one that ``corrected`` made has none there yet."""
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

    def made_folder(self, name: str) -> Path:
        """The folder ``name`` of the bundle, made where it is missing. Raises SceneError as ``publishing``."""
        folder = inside(self.path, name)
        locks.require_there(self.path)
        make_folder(folder, self.path)
        return folder

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

    # ---- what is in it

    def read(self, artifact: Artifact[Held]) -> Held:
        """What the bundle holds under an artifact's name. Raises R2SEgoError for damage."""
        return artifact.load(self.path / artifact.name)

    @contextlib.contextmanager
    def publishing(self, target: str) -> Iterator[Path]:
        """A path to write at; on leaving without an error it takes ``target``'s place.

        A cancelled process leaves nothing of it. Raises SceneError where the place is outside of the
        bundle, and where the bundle was removed or replaced meanwhile.
        """
        place = inside(self.path, target)
        staging = place.with_name(UNFINISHED + place.name)
        try:
            locks.require_there(self.path)
            make_folder(place.parent, self.path)
            remove(staging)
            if not place.suffix:
                staging.mkdir()
            with scratch_place(staging):
                yield staging
                flush(staging)
                locks.require_there(self.path)
                with keeping(staging):
                    swap_in(staging, place)
        except FileNotFoundError:
            locks.require_there(self.path)  # that is why, and what a person has to know
            raise
        finally:
            remove(staging)

    @contextlib.contextmanager
    def corrected(self) -> Iterator[Scene]:
        """A scene without content to publish in what stands in the world frame, and to declare.

        On leaving without an error all of that replaces this one's. Killed on the way, none has, or
        the next who holds the lock puts the rest there.
        """
        with disk_errors(self.path), replacing_together(self.path, locks.CORRECTED_TOGETHER) as folder:
            yield Scene(folder, self._declaration_now())

    @property
    def backends(self) -> dict[str, str]:
        """The backend of each slot: as declared, and what estimated depth and drove the last rollouts."""
        return {**self.declaration.backends, **layout_backend(self.path), **controller_backend(self.path)}

    def journal(self) -> list[dict[str, Any]]:
        """The records of every step run so far, oldest first."""
        return self._journal.steps()

    def recorded(self) -> dict[str, str]:
        """The digest of what each step read, by its target (``Journal.inputs``)."""
        return self._journal.inputs()

    def outputs(self) -> dict[str, str]:
        """The ``content_digest`` of each step's last result, by its target (``Journal.outputs``)."""
        return self._journal.outputs()

    def note(self, **record: Any) -> None:
        """Add a record to the journal. Raises OSError, and SceneError where the bundle was removed."""
        locks.require_there(self.path)
        self._journal.write(**record)

    def locked(self) -> contextlib.AbstractContextManager[None]:
        """Hold the bundle for writing (``locks.locked``)."""
        return locks.locked(self.path)

    def held_still(self, patience_s: float = 0.0) -> contextlib.AbstractContextManager[None]:
        """Keep others from writing while it is read (``locks.held_still``)."""
        return locks.held_still(self.path, patience_s)
