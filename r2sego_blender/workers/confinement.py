"""What a process gives up for good before it runs what a stranger made.

On Linux, Landlock takes away writing files and reading others than Python's and its packages', and
seccomp the network, other programs and other processes: both need no rights, and last for all that
the process starts. Sources: the kernel's landlock(7) and seccomp(2). Standard library alone.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import struct
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path

from .library_path import LIBRARY

WRITING, READING, NETWORK, MEMORY = "writing files", "reading other files", "the network", "memory without bounds"
"""What may be taken away, as ``confine`` and ``bound_memory`` name what they could not."""

_NO_NEW_RIGHTS, _SET_FILTER, _FILTER = 38, 22, 2  # of prctl

# Landlock: its calls have these numbers on every processor; its versions know ever more ways to write.
_CREATE, _ADD_RULE, _RESTRICT, _VERSION = 444, 445, 446, 1
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3
_KNOWN_TO = {1: 1 << 13, 2: 1 << 14, 3: 1 << 15, 5: 1 << 16}
_TCP, _SIGNALS_AND_SOCKETS = 0b11, 0b11
_OF_THE_SYSTEM = (
    *("/usr", "/lib", "/lib64", "/bin", "/nix/store", "/etc/ld.so.cache", "/etc/localtime"),
    *("/proc/self", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/sys/vm", "/sys/devices", "/sys/bus"),
    *("/dev/null", "/dev/urandom", "/dev/random", "/dev/zero"),
)

# The calls that are refused, by the processor: its mark, socket, execve, execveat, ptrace,
# process_vm_readv, process_vm_writev, kill, io_uring_setup (which opens sockets, too).
_CALLS = {
    "x86_64": (0xC000003E, 41, 59, 322, 101, 310, 311, 62, 425),
    "aarch64": (0xC00000B7, 198, 221, 281, 117, 270, 271, 129, 425),
}
_OTHER_ABI = 0x40000000  # x86-64's calls once more, under other numbers
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_ALLOWED, _NOT_PERMITTED = 0x7FFF0000, 0x00050001


def confine(readable: Iterable[Path] = ()) -> tuple[str, ...]:
    """Give up writing, reading but for ``readable`` and Python's own, and the network, for good.

    Files that are open stay so. Call it while the process has one thread: others keep their rights.
    Returns what this system cannot take away.
    """
    if not sys.platform.startswith("linux"):
        return WRITING, READING, NETWORK
    system = ctypes.CDLL(None, use_errno=True)
    if system.prctl(_NO_NEW_RIGHTS, 1, 0, 0, 0) != 0:
        return WRITING, READING, NETWORK
    left = () if _restrict_files(system, [*_libraries(), *readable]) else (WRITING, READING)
    return left if _refuse_calls(system) else (*left, NETWORK)


def bound_memory(more_bytes: int) -> tuple[str, ...]:
    """Let this process take no more than ``more_bytes`` beyond what it has; returns as ``confine``."""
    if not sys.platform.startswith("linux"):
        return (MEMORY,)
    import resource

    fields = Path("/proc/self/statm").read_text().split()
    # Pages that are private and may be written, as the limit counts them.
    present = int(fields[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (present + more_bytes, present + more_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return ()


def _libraries() -> list[Path]:
    """Where Python, its packages and the system's libraries lie."""
    own = [*sysconfig.get_paths().values(), sys.prefix, sys.base_prefix, *sys.path, *_OF_THE_SYSTEM]
    return [LIBRARY, *(Path(place) for place in own if place)]


def _restrict_files(system: ctypes.CDLL, readable: Iterable[Path]) -> bool:
    """Whether Landlock now refuses writing, and reading elsewhere."""
    version = system.syscall(_CREATE, None, 0, _VERSION)
    if version < 1:
        return False
    everything = max(bits for since, bits in _KNOWN_TO.items() if since <= version) - 1
    asked = struct.pack("=QQQ", everything, _TCP if version >= 4 else 0, _SIGNALS_AND_SOCKETS if version >= 6 else 0)
    size = 24 if version >= 6 else 16 if version >= 4 else 8
    rules = system.syscall(_CREATE, asked, ctypes.c_size_t(size), 0)
    if rules < 0:
        return False
    try:
        for place in readable:
            _allow(system, rules, place, _READ_FILE | _READ_FOLDER)
        return bool(system.syscall(_RESTRICT, rules, 0) == 0)
    finally:
        os.close(rules)


def _allow(system: ctypes.CDLL, rules: int, place: Path, access: int) -> None:
    with contextlib.suppress(OSError):  # what is not there needs no rule
        if not place.is_dir():
            access &= ~_READ_FOLDER
        descriptor = os.open(place, os.O_PATH | os.O_CLOEXEC)
        try:
            system.syscall(_ADD_RULE, rules, 1, struct.pack("=Qi", access, descriptor), 0)
        finally:
            os.close(descriptor)


def _refuse_calls(system: ctypes.CDLL) -> bool:
    """Whether seccomp now refuses ``_CALLS``."""
    if platform.machine() not in _CALLS:
        return False
    mark, *calls = _CALLS[platform.machine()]
    refuse = len(calls) + 3  # lines from the second to the last
    program = [(_LOAD, 0, 0, 4), (_EQUAL, 0, refuse, mark), (_LOAD, 0, 0, 0), (_AT_LEAST, refuse - 2, 0, _OTHER_ABI)]
    program += [(_EQUAL, len(calls) - index, 0, call) for index, call in enumerate(calls)]
    program += [(_RETURN, 0, 0, _ALLOWED), (_RETURN, 0, 0, _NOT_PERMITTED)]
    lines = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *line) for line in program))
    whole = struct.pack("@HP", len(program), ctypes.addressof(lines))
    return bool(system.prctl(_SET_FILTER, _FILTER, whole, 0, 0) == 0)
