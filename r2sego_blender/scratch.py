"""Temporary folders that also go when the process is cancelled."""

from __future__ import annotations

import shutil
import tempfile

_NAMES: set[str] = set()


class ScratchFolder(tempfile.TemporaryDirectory):
    """A temporary folder: gone with its ``with`` block, with the process, and with ``remove_scratch``.

    A cancelled process ends without leaving its blocks, so it has to ask for the last.
    """

    def __init__(self) -> None:
        super().__init__(prefix="r2sego-", ignore_cleanup_errors=True)
        _NAMES.add(self.name)

    def cleanup(self) -> None:
        """Remove the folder now."""
        super().cleanup()
        _NAMES.discard(self.name)


def remove_scratch() -> None:
    """Remove every scratch folder of this process, whatever still uses it."""
    for name in tuple(_NAMES):
        shutil.rmtree(name, ignore_errors=True)
