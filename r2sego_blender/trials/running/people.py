"""The people at a session: one at the terminal, and whoever appends to the file of controls, as Blender does."""

from __future__ import annotations

from pathlib import Path

from .controls import Controls, Told
from .keys import KeyReader, Keys
from .live import Live


class People:
    """What they do at the study in ``study``; without a ``reader`` there is no terminal."""

    def __init__(self, study: Path, keys: Keys, reader: KeyReader | None) -> None:
        self._controls, self._keys, self._reader = Controls(study), keys, reader

    def acts(self, live: Live) -> list[Told]:
        """What they have done since they were last asked."""
        typed = "" if self._reader is None else self._reader.read()
        return [*self._keys.typed(typed), *self._controls.read()]
