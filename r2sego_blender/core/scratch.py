"""Temporary folders, and files being written, that also go when the process is cancelled."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

_NAMES: set[str] = set()

_MAKING = threading.Lock()

_ATTEMPTS, _PAUSE_S = 20, 0.01  # another thread may write a file into a folder that is being removed


class ScratchFolder(tempfile.TemporaryDirectory):
    """A temporary folder: gone with its ``with`` block, with the process, and with ``remove_scratch``.

    A cancelled process ends without leaving its blocks, so it has to ask for the last.
    """

    def __init__(self) -> None:
        with _MAKING:
            super().__init__(prefix="r2sego-", ignore_cleanup_errors=True)
            _NAMES.add(self.name)

    def cleanup(self) -> None:
        """Remove the folder now."""
        super().cleanup()
        _NAMES.discard(self.name)


@contextlib.contextmanager
def scratch_place(place: Path) -> Iterator[None]:
    """Within its ``with`` block a folder or file goes with ``remove_scratch``; else its user removes it.

    One that comes to stay leaves in a block of ``keeping``.
    """
    with _MAKING:
        _NAMES.add(str(place))
    try:
        yield
    finally:
        _NAMES.discard(str(place))


@contextlib.contextmanager
def keeping(place: Path) -> Iterator[None]:
    """Within its ``with`` block a scratch place is renamed to where it stays: whole, or not at all.

    Else who removes it might still be at it. A process that is being cancelled stays before the block.
    """
    with _MAKING:
        yield
        _NAMES.discard(str(place))


def remove_scratch(for_good: bool = False) -> None:
    """Remove every scratch folder and file of this process, whatever still uses it.

    ``for_good`` where the process ends next: who asks for another, or to keep one, waits for ever.
    """
    if for_good:
        _MAKING.acquire()
    for name in tuple(_NAMES):
        for _ in range(_ATTEMPTS):
            shutil.rmtree(name, ignore_errors=True)
            with contextlib.suppress(OSError):
                Path(name).unlink()
            if not os.path.lexists(name):
                break
            time.sleep(_PAUSE_S)
