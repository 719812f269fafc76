"""Cells whose machines share no disk: each takes what it needs from storage, and puts there what it made."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from .. import __version__
from ..core.atomic_files import remove
from ..core.errors import ExperimentError
from ..core.file_locks import wait_for_lock
from ..core.user_configuration import cache_folder
from .cells import Cell
from .equipment import equipment
from .object_store import ObjectStore
from .records import RECORD, Record, final_record
from .running import Outcome, RunCell, failure

_OF_TABLES = re.compile(r"record\.json|log\.txt|bundle\.r2s/(scene\.toml|journal\.jsonl|report/.*(?<!\.ply))")
_ABOVE = 4  # a cell's folder is EXPERIMENT/cells/PRESET/SCENE/COUNT/seed_S


def put_scenes(cells: Sequence[Cell], store: ObjectStore) -> None:
    """Publish what the cells' scenes are made of.

    Raises ExperimentError for a scene that is more than the folder of its photographs.
    """
    for cell in {_of_scene(cell): cell for cell in cells}.values():
        scene = cell.scene
        own = [scene.frozen, *([scene.poses] if scene.poses else [])]
        elsewhere = [str(file) for file in own if not file.is_relative_to(scene.captures)]
        elsewhere += [name for name in (scene.robot, scene.scope) if Path(name).is_file()]
        if scene.is_bundle or elsewhere:
            raise ExperimentError(
                f"the scene {scene.name} cannot be put into storage: {', '.join(elsewhere) or 'it is a bundle'}",
                where=scene.captures,
                cure="Give a folder that has its photographs, poses and frozen views, and robots and scopes by name.",
            )
        store.publish(scene.captures, _of_scene(cell))


def bring(cell: Cell, store: ObjectStore) -> None:
    """Into the experiment's folder what its tables and its page need of a cell, and the import that others share.

    Raises ExperimentError.
    """
    store.fetch(_relative(cell, cell.folder), cell.folder, lambda name: bool(_OF_TABLES.fullmatch(name)))
    if not cell.imported.exists():
        store.fetch(_relative(cell, cell.imported), cell.imported)


@dataclass(frozen=True)
class StoredCells:
    """Does a cell by ``run_cell`` in a folder of this machine, wherever the experiment's own is.

    A cell that is done is not done again; one that was begun elsewhere goes on from what stands in the ``store``.
    """

    store: ObjectStore
    run_cell: RunCell

    def __call__(self, cell: Cell) -> Outcome:
        """See ``RunCell``."""
        try:
            root = cache_folder() / "experiments" / hashlib.sha256(self.store.url.encode()).hexdigest()[:16]
            here = _moved(cell, root)
            with _alone(root):
                if (record := self._record(cell, here)) is not None:
                    return Outcome(record)
                self._take(cell, here)
            outcome = self.run_cell(here)
            if here.imported.exists() and not self.store.has(_relative(cell, cell.imported)):
                self.store.publish(here.imported, _relative(cell, cell.imported))
            if here.bundle.exists():
                self.store.publish(here.folder, _relative(cell, cell.folder))
            return outcome
        except Exception as error:
            return failure(cell, error)

    def _take(self, cell: Cell, here: Cell) -> None:
        """What the cell is made of, and what others have made of it."""
        if not self.store.fetch(_of_scene(cell), here.scene.captures):
            raise ExperimentError(
                f"the scene {cell.scene.name} is not there", where=self.store.url, cure="Start the experiment again."
            )
        for there, place in ((cell.imported, here.imported), (cell.folder, here.folder)):
            if not place.exists():
                self.store.fetch(_relative(cell, there), place)

    def _record(self, cell: Cell, here: Cell) -> Record | None:
        """Of a cell that is done, on whichever machine."""
        place = here.folder.with_name(f".record-{here.folder.name}")
        try:
            self.store.fetch(_relative(cell, cell.folder), place, lambda name: name == RECORD)
            return final_record(place, cell.key, equipment(cell.arms))
        finally:
            remove(place)


def _of_scene(cell: Cell) -> str:
    return f"{_inputs_digest(cell)}/scenes/{cell.scene.name}"


def _relative(cell: Cell, place: Path) -> str:
    return f"{_inputs_digest(cell)}/{place.relative_to(cell.folder.parents[_ABOVE]).as_posix()}"


def _inputs_digest(cell: Cell) -> str:
    """Of other photographs, held-out views or versions nothing is taken, though the names are the same."""
    made_of = [__version__, asdict(cell.inputs)]
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()[:16]


def _moved(cell: Cell, root: Path) -> Cell:
    """The cell as it lies below ``root`` on this machine."""
    scene, captures = cell.scene, root / _of_scene(cell)

    def within(file: Path) -> Path:
        return captures / file.relative_to(scene.captures)

    poses = within(scene.poses) if scene.poses else None
    moved = replace(scene, captures=captures, frozen=within(scene.frozen), poses=poses)
    folder, imported = (root / _relative(cell, place) for place in (cell.folder, cell.imported))
    return replace(cell, scene=moved, folder=folder, imported=imported)


@contextlib.contextmanager
def _alone(root: Path) -> Iterator[None]:
    """Within its ``with`` block no other process of this machine takes anything from storage."""
    root.mkdir(parents=True, exist_ok=True)
    with (root / ".lock").open("ab") as file:
        wait_for_lock(file)
        yield
