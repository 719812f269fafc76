"""Processes as the system knows them: who still lives, groups of their own, and their end.

Standard library alone, on Linux, macOS and Windows.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any


def birth(pid: int) -> str:
    """When the process ``pid`` began, as a mark to compare; "" when there is none, or it has ended.

    Numbers of processes are used again: only number and birth together name one process.
    """
    if pid <= 0:
        return ""
    return _birth(pid)


def end_tree(process: subprocess.Popen) -> None:
    """Kill a process started with ``group_of_its_own``, and what it started."""
    if os.name == "nt":
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True)
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def interrupt_group(process: subprocess.Popen) -> None:
    """Ask a process started with ``group_of_its_own`` to end, as Ctrl-C does."""
    with contextlib.suppress(OSError):
        if os.name == "nt":
            process.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(process.pid, signal.SIGINT)


def group_of_its_own(window: bool = True) -> dict[str, Any]:
    """Arguments of Popen for a process that its starter's end or Ctrl-C does not reach.

    ``window`` False also gives it no console on Windows.
    """
    if os.name == "nt":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP
        return {"creationflags": flags if window else flags | subprocess.CREATE_NO_WINDOW}
    return {"start_new_session": True}


def die_with_parent() -> None:
    """Let the system end this process with its parent, where it can (Linux); for ``preexec_fn``."""
    if _PRCTL is not None:
        _PRCTL(_SET_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)


_SET_DEATH_SIGNAL = 1
_PRCTL = ctypes.CDLL(None).prctl if sys.platform.startswith("linux") else None

if sys.platform.startswith("linux"):

    def _birth(pid: int) -> str:
        try:
            fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            return ""
        return "" if fields[0] in "ZX" else f"{_boot()} {fields[19]}"

    @functools.cache
    def _boot() -> str:
        with contextlib.suppress(OSError):
            return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return ""

elif os.name == "nt":

    def _birth(pid: int) -> str:
        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = ctypes.c_void_p(kernel.OpenProcess(0x1000, False, pid))  # may only be asked about
        if not handle:
            return ""
        try:
            status, times = ctypes.c_ulong(), (ctypes.c_ulonglong * 4)()
            kernel.GetExitCodeProcess(handle, ctypes.byref(status))
            places = [ctypes.byref(times, 8 * index) for index in range(4)]
            kernel.GetProcessTimes(handle, *places)
            return str(times[0]) if status.value == 259 else ""  # 259: it still runs
        finally:
            kernel.CloseHandle(handle)

else:

    def _birth(pid: int) -> str:
        told = subprocess.run(["ps", "-o", "stat=,lstart=", "-p", str(pid)], capture_output=True, text=True)
        state, _, began = told.stdout.strip().partition(" ")
        return "" if state.startswith("Z") else began.strip()
