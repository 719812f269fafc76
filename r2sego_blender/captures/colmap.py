"""pycolmap, imported late (it is slow to load) and kept quiet."""

from __future__ import annotations

import signal
import threading
from types import ModuleType


def load_pycolmap() -> ModuleType:
    """The module, saying nothing below an error.

    Its import puts a handler on SIGTERM that prints a stack trace and aborts; the one that
    was there before, which ends the work cleanly, is put back.
    """
    handler = signal.getsignal(signal.SIGTERM)
    import pycolmap

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, handler)
    pycolmap.logging.minloglevel = 2
    return pycolmap
