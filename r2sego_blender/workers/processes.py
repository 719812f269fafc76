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
    """Kill a process started with ``group_of_its_own``, and what it started.

    On Windows, where those of a parent that has ended are found no more, only after
    ``take_children_along`` all of them, and then all that this process started.
    """
    if sys.platform == "win32":
        if _JOB:
            _end_others_in(_JOB)
        else:
            command = ["taskkill", "/T", "/F", "/PID", str(process.pid)]
            subprocess.run(command, capture_output=True, **NO_WINDOW)
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def ended_with_this_process(process: subprocess.Popen, pause_s: float = 0.0) -> subprocess.Popen:
    """A process that kills ``process``, started with ``group_of_its_own``, and what it started, once this one is gone.

    However this one ends, the pipe to it does too; ``pause_s`` lets ``process`` hear of it first. Kill what this
    returns before ``process`` is waited for.
    """
    command = [sys.executable, "-I", "-S", "-c", _END_AFTER_INPUT, str(process.pid), str(pause_s)]
    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **group_of_its_own(window=False),
    )


def interrupt_group(process: subprocess.Popen) -> None:
    """Ask a process started with ``group_of_its_own`` to end, as Ctrl-C does."""
    with contextlib.suppress(OSError):
        if sys.platform == "win32":
            process.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(process.pid, signal.SIGINT)


def group_of_its_own(window: bool = True) -> dict[str, Any]:
    """Arguments of Popen for a process that its starter's end or Ctrl-C does not reach.

    ``window`` False also gives it no console on Windows.
    """
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP
        return {"creationflags": flags if window else flags | subprocess.CREATE_NO_WINDOW}
    return {"start_new_session": True}


def die_with_parent() -> None:
    """Let the system end this process with its parent, where it can (Linux)."""
    if _PRCTL is not None:
        _PRCTL(_SET_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)


def take_children_along() -> None:
    """However this process ends, all it starts from now on ends with it, where it can (Windows)."""
    global _JOB
    if sys.platform == "win32":
        _JOB = _job_of_this_process()


NO_WINDOW: dict[str, Any] = {}
"""Arguments of Popen for a process that opens no console on Windows, also from a Blender without one."""
if sys.platform == "win32":
    NO_WINDOW["creationflags"] = subprocess.CREATE_NO_WINDOW

_JOB: int | None = None
_SET_DEATH_SIGNAL = 1
_PRCTL = ctypes.CDLL(None).prctl if sys.platform.startswith("linux") else None

DYING_WITH_PARENT: dict[str, Any] = {"preexec_fn": die_with_parent} if _PRCTL is not None else {}
"""Arguments of Popen for a process that the system ends with this one, where it can."""

_END_AFTER_INPUT = """\
import os, signal, subprocess, sys, time
sys.stdin.read()
time.sleep(float(sys.argv[2]))
if os.name == "nt":
    subprocess.run(["taskkill", "/T", "/F", "/PID", sys.argv[1]], capture_output=True)
else:
    os.killpg(int(sys.argv[1]), signal.SIGKILL)
"""

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

elif sys.platform == "win32":
    _ASK, _STILL_RUNS = 0x1000, 259
    _LIST, _LIMITS, _KILL_ON_CLOSE, _MOST = 3, 9, 0x2000, 4096

    _KERNEL = ctypes.WinDLL("kernel32", use_last_error=True)
    for _name in ("OpenProcess", "CreateJobObjectW", "GetCurrentProcess"):
        getattr(_KERNEL, _name).restype = ctypes.c_void_p

    def _birth(pid: int) -> str:
        handle = ctypes.c_void_p(_KERNEL.OpenProcess(_ASK, False, pid))
        if not handle:
            return ""
        try:
            status, times = ctypes.c_ulong(), (ctypes.c_ulonglong * 4)()
            _KERNEL.GetExitCodeProcess(handle, ctypes.byref(status))
            places = [ctypes.byref(times, 8 * index) for index in range(4)]
            _KERNEL.GetProcessTimes(handle, *places)
            return str(times[0]) if status.value == _STILL_RUNS else ""
        finally:
            _KERNEL.CloseHandle(handle)

    class _Limits(ctypes.Structure):
        """JOBOBJECT_EXTENDED_LIMIT_INFORMATION, of which the flags alone are set here."""

        _fields_ = (
            ("times", ctypes.c_int64 * 2),
            ("flags", ctypes.c_uint32),
            ("set", ctypes.c_size_t * 2),
            ("processes", ctypes.c_uint32),
            ("affinity", ctypes.c_size_t),
            ("priority", ctypes.c_uint32 * 2),
            ("transfers", ctypes.c_uint64 * 6),
            ("memory", ctypes.c_size_t * 4),
        )

    class _Members(ctypes.Structure):
        """JOBOBJECT_BASIC_PROCESS_ID_LIST."""

        _fields_ = (("assigned", ctypes.c_uint32), ("count", ctypes.c_uint32), ("pids", ctypes.c_size_t * _MOST))

    def _job_of_this_process() -> int | None:
        """A job object of this process and all it starts; the system ends them with its last handle."""
        job = _KERNEL.CreateJobObjectW(None, None)
        limits = _Limits(flags=_KILL_ON_CLOSE)
        place, this = ctypes.c_void_p(job), ctypes.c_void_p(_KERNEL.GetCurrentProcess())
        _KERNEL.SetInformationJobObject(place, _LIMITS, ctypes.byref(limits), ctypes.sizeof(limits))
        return job if _KERNEL.AssignProcessToJobObject(place, this) else None

    def _end_others_in(job: int) -> None:
        members = _Members()
        size = ctypes.sizeof(members)
        _KERNEL.QueryInformationJobObject(ctypes.c_void_p(job), _LIST, ctypes.byref(members), size, None)
        for pid in members.pids[: members.count]:
            if pid != os.getpid():
                with contextlib.suppress(OSError):
                    os.kill(pid, signal.SIGTERM)  # which ends it at once there

else:

    def _birth(pid: int) -> str:
        return _told_by_ps(pid)


def _told_by_ps(pid: int) -> str:
    # Its date is written in the asker's language and time zone, which another asker need not share.
    variables = {**os.environ, "LC_ALL": "C", "TZ": "UTC"}
    command = ["ps", "-o", "stat=", "-o", "lstart=", "-p", str(pid)]
    state, _, began = (
        subprocess.run(command, env=variables, capture_output=True, text=True).stdout.strip().partition(" ")
    )
    return "" if state.startswith("Z") else began.strip()
