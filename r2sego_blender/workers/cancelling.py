"""How a command ends when it is told to: at once, with all that it has started."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import threading

from ..core.scratch import remove_scratch
from .child import kill_children


def cancel_at_once(kept: str = "") -> None:
    """Let SIGINT, SIGTERM, SIGHUP and Ctrl-Break end the process within moments, with its native calls.

    Python's own handlers wait for the main thread to leave a compiled kernel; a thread
    that reads the wake-up pipe does not. Nothing published is half-written at any time.
    ``kept`` says what the command leaves, where it leaves something.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    _hush_resource_tracker()
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGBREAK"):  # Ctrl-Break, as Blender cancels on Windows
        numbers.append(signal.SIGBREAK)
    for number in numbers:
        signal.signal(number, lambda *_: None)
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # not so under nohup
        signal.signal(signal.SIGHUP, lambda *_: None)

    def wait(writer: socket.socket) -> None:  # its argument stays open as long as the thread lives
        number = reader.recv(1)[0]
        kill_children(for_good=True)
        remove_scratch(for_good=True)
        said = "; ".join(filter(None, ["\nr2sego: cancelled", kept])) + "\n"
        with contextlib.suppress(OSError):  # the terminal is gone
            shown_again = "\x1b[?25h" if os.isatty(2) else ""  # a bar hides the cursor, and keeps sys.stderr
            os.write(2, (shown_again + said).encode())
        os._exit(128 + number)

    threading.Thread(target=wait, args=(writer,), name="cancel", daemon=True).start()


def _hush_resource_tracker() -> None:
    """Multiprocessing's tracker cleans up after a process that ends at once, and would say so last."""
    hushed, told = "ignore:resource_tracker", os.environ.get("PYTHONWARNINGS", "")
    if hushed not in told:
        os.environ["PYTHONWARNINGS"] = f"{told},{hushed}".lstrip(",")
