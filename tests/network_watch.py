"""Which addresses a command and all that it starts reach for: ``strace`` watches its calls of the system.

``reached(["r2sego", "demo", "demo.r2s"])`` is [] where it reaches for nothing beyond this machine.
"""

import functools
import ipaddress
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

_CALL = re.compile(r"\b(connect|sendto|sendmsg|sendmmsg)\(")
_FAMILY = re.compile(r"sa_family=(AF_\w+)")
_ADDRESS = re.compile(r'inet_addr\("([^"]+)"\)|inet_pton\(AF_INET6, "([^"]+)"')
_PORT = re.compile(r"sin6?_port=htons\((\d+)\)")
_NAME_SERVICES = re.compile(r'sun_path="[^"]*(nscd|systemd/resolve)[^"]*"')
# The kernel's filter stops the watched calls alone (strace 5.3): every other one costs as much as ever.
_STRACE = ("strace", "-f", "--seccomp-bpf", "-e", "trace=%network", "-e", "signal=none")
_OF_THIS_MACHINE = ("AF_UNIX", "AF_UNSPEC", "AF_NETLINK")


@dataclass(frozen=True)
class Reached:
    """An address that was reached for: the call, "ADDRESS:PORT", and strace's line; port 53 asks for a name."""

    call: str
    address: str
    line: str

    @property
    def is_lookup(self):
        return self.address.endswith(":53") or self.address == "a name service"


@functools.cache
def why_not():
    """Why nothing can be watched here, '' where it can."""
    if not sys.platform.startswith("linux") or shutil.which("strace") is None:
        return "strace is not installed"
    tried = subprocess.run([*_STRACE, "-o", "/dev/null", "true"], capture_output=True, text=True)
    return "" if tried.returncode == 0 else f"processes cannot be traced here: {tried.stderr.strip()[-200:]}"


def watched(command, log, timeout_s=600.0, **popen):
    """The command, ended, and what it reached for; the test is skipped where nothing can be watched.

    ``log`` is a file that strace may write, ``popen`` further arguments of ``subprocess.run``. The command's
    own confinement (seccomp, Landlock) works on under strace.
    """
    if reason := why_not():
        pytest.skip(reason)
    strace = [*_STRACE, "-qq", "-s", "256", "-o", str(log)]
    done = subprocess.run([*strace, *map(str, command)], timeout=timeout_s, **popen)
    return done, reached_in(Path(log).read_text(encoding="utf-8", errors="replace"))


def reached(command, log, **options):
    """What a command that must succeed reached for beyond this machine."""
    done, found = watched(command, log, **options)
    assert done.returncode == 0, f"{command} ended with {done.returncode}"
    return found


def reached_in(log):
    """The addresses beyond this machine in a log of strace."""
    found = []
    for line in log.splitlines():
        if not (call := _CALL.search(line)):
            continue
        if _NAME_SERVICES.search(line):
            if "ENOENT" in line:  # none runs: users are asked for there, too, and a host would go on to port 53
                continue
            found.append(Reached(call[1], "a name service", line))
            continue
        families = _FAMILY.findall(line)
        if not families or all(family in _OF_THIS_MACHINE for family in families):
            continue  # sendto of a connected socket: it was seen as it connected
        addresses = [one or other for one, other in _ADDRESS.findall(line)]
        ports = _PORT.findall(line)
        if addresses and all(_is_loopback(address) for address in addresses) and "53" not in ports:
            continue
        shown = addresses[0] if addresses else families[0]
        found.append(Reached(call[1], f"{shown}:{ports[0]}" if ports else shown, line))
    return found


def _is_loopback(address):
    one = ipaddress.ip_address(address)
    return one.is_loopback or bool(getattr(one, "ipv4_mapped", None) and one.ipv4_mapped.is_loopback)
