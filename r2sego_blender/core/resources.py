"""The machine, and what this process has used of it: processor seconds and memory."""

from __future__ import annotations

import contextlib
import math
import os
import platform
import sys
from pathlib import Path

from .errors import MachineError

_LEAST_ADDRESSES = 10**9  # bytes that the numeric packages take once loaded
_PAGES = Path("/proc/self/statm")
_GROUP = Path("/sys/fs/cgroup")
_QUOTA = _GROUP / "cpu.max"


def require_addresses() -> None:
    """Raise MachineError where a limit such as ``ulimit -v`` lets the numeric packages not be loaded.

    At some limits OpenBLAS asks for its memory again without end, and cannot be cancelled.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < _LEAST_ADDRESSES:
        raise MachineError(
            f"a process may use only {limit / 1e6:.0f} MB of addresses here",
            where="ulimit -v",
            cure="Allow several GB, or limit the memory in another way.",
        )


def limit_memory(more_bytes: int) -> None:
    """Let this process, a child that reads what others wrote, take so many bytes of addresses at most.

    They are counted from here on: what packages have loaded for each processor is not of the file.
    """
    try:
        import resource

        pages = int(_PAGES.read_text().split()[0]) if _PAGES.is_file() else 0
        most_bytes = pages * resource.getpagesize() + more_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    except (ImportError, ValueError, OSError):  # Windows has no such limit, some systems forbid it
        return


def cpu_s() -> float:
    """Processor seconds that this process and its ended children have taken so far."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def available_cores() -> int:
    """The processor's cores that this process may use, at most NUMBA_NUM_THREADS where that is set.

    A container's share of the processor counts (control groups of version 2).
    """
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # macOS, Windows
        cores = os.cpu_count() or 1
    with contextlib.suppress(OSError, ValueError):
        quota_us, period_us = _QUOTA.read_text().split()
        if quota_us != "max":
            cores = min(cores, math.ceil(int(quota_us) / int(period_us)))
    with contextlib.suppress(ValueError):
        cores = min(cores, int(os.environ.get("NUMBA_NUM_THREADS", cores)))
    return max(cores, 1)


def forget_peak_memory() -> None:
    """Let ``peak_memory_mb`` begin anew; where the system cannot, it goes on from the start."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # proc(5): the peak is set to what is used now


def peak_memory_mb() -> float | None:
    """The most memory (resident, MiB) this process ever had, or None where nobody counts it."""
    with contextlib.suppress(OSError, StopIteration):
        # Linux's getrusage counts what the process that started this one had, too.
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM:")).split()[1]) / 2**10
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def available_memory_mb() -> float:
    """Memory (MiB) that processes started now may take, a container's limit included; infinite where nobody tells."""
    free = [math.inf]
    with contextlib.suppress(OSError, StopIteration, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        free.append(int(next(line for line in lines if line.startswith("MemAvailable:")).split()[1]) / 2**10)
    with contextlib.suppress(OSError, ValueError, KeyError):  # without a limit it reads "max"
        most = int((_GROUP / "memory.max").read_text())
        told = dict(line.split() for line in (_GROUP / "memory.stat").read_text().splitlines())
        used = int((_GROUP / "memory.current").read_text()) - int(told["inactive_file"])  # files are let go
        free.append((most - used) / 2**20)
    return max(min(free), 0.0)


def processor() -> str:
    """The processor's name as the system tells it."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
