"""Ctrl-C while an operator waits for the engine.

Blender without a window keeps the first for what it renders itself, and ends at the second without a word to Python.
"""

import contextlib
import ctypes
import signal
import threading
from collections.abc import Iterator

import bpy

# Python's module signal can neither name nor put back a handler that is written in C.
_handler = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_int)(("PyOS_getsig", ctypes.pythonapi))
_set_handler = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)(("PyOS_setsig", ctypes.pythonapi))


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt in what is done within; a handler that is Python's own stays, and ignoring it."""
    python = signal.getsignal(signal.SIGINT)
    is_main = threading.current_thread() is threading.main_thread()
    if not (bpy.app.background and is_main) or callable(python) or python is signal.SIG_IGN:
        yield
        return
    blenders = _handler(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        _set_handler(signal.SIGINT, blenders)
