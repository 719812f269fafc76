"""What tests need of the system and pip does not bring: name it in one line, or install it.

pip's bpy wants libraries of X11 and GL, EEVEE aborts its process without EGL, one test asks ``ps``, what
watches the network is strace, and a trial's firmware is tried as g++ compiles it.
Needs only the standard library, so that it can run before anything is installed:

    python3 batch/check_system.py            exit 0, or 1 and the one line that installs what is missing;
                                             as root that line is told and run
    python3 batch/check_system.py --yes      the same as any user, through sudo
    python3 batch/check_system.py --packages the missing packages alone, for a script
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable

# What `ldd` of bpy 4.5's library names beyond the C runtime and its own folder, and EGL, which it opens
# by name to draw: library -> package on (Debian and Ubuntu, Fedora, Arch).
LIBRARIES = {
    "libX11.so.6": ("libx11-6", "libX11", "libx11"),
    "libXext.so.6": ("libxext6", "libXext", "libxext"),
    "libXrender.so.1": ("libxrender1", "libXrender", "libxrender"),
    "libXfixes.so.3": ("libxfixes3", "libXfixes", "libxfixes"),
    "libXi.so.6": ("libxi6", "libXi", "libxi"),
    "libxkbcommon.so.0": ("libxkbcommon0", "libxkbcommon", "libxkbcommon"),
    "libSM.so.6": ("libsm6", "libSM", "libsm"),
    "libICE.so.6": ("libice6", "libICE", "libice"),
    "libGL.so.1": ("libgl1", "mesa-libGL", "libglvnd"),
    "libEGL.so.1": ("libegl1", "mesa-libEGL", "mesa"),
}

PROGRAMS = {
    "ps": ("procps", "procps-ng", "procps-ng"),
    "strace": ("strace", "strace", "strace"),
    "g++": ("g++", "gcc-c++", "gcc"),
}

INSTALLERS = (
    # A bare machine has no lists of packages yet.
    ("apt-get", ("apt-get update -qq", "apt-get install -y --no-install-recommends")),
    ("dnf", ("dnf install -y",)),
    ("pacman", ("pacman -S --noconfirm",)),
)


def missing_parts(
    load: Callable[[str], object] = ctypes.CDLL, which: Callable[[str], object] = shutil.which
) -> list[str]:
    """The libraries that ``load`` cannot open and the programs that are not there; none off Linux."""
    if not sys.platform.startswith("linux"):
        return []
    missing = []
    for library in LIBRARIES:
        try:
            load(library)
        except OSError:
            missing.append(library)
    return missing + [program for program in PROGRAMS if not which(program)]


def packages_of(missing: list[str], column: int) -> list[str]:
    return [(LIBRARIES | PROGRAMS)[part][column] for part in missing]


def cure(missing: list[str], which: Callable[[str], object] | None = None) -> list[str]:
    """The commands that install what is missing with this machine's package manager; [] with none."""
    for column, (program, commands) in enumerate(INSTALLERS):
        if (which or shutil.which)(program):
            return [*commands[:-1], " ".join([commands[-1], *packages_of(missing, column)])]
    return []


def install(commands: list[str]) -> int:
    """Run the commands, each as words; the first status that is not 0."""
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for command in commands:
        # What apt-get says of every package would hide the tests' own lines.
        done = subprocess.run(command.split(), env=environment, stdin=subprocess.DEVNULL, stdout=sys.stderr)
        if done.returncode:
            return done.returncode
    return 0


def main(arguments: list[str]) -> int:
    missing = missing_parts()
    if not missing:
        return 0
    if "--packages" in arguments:
        print(" ".join(packages_of(missing, 0)))
        return 1
    wanted = f"The tests need {', '.join(missing)}"
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    commands = [command if root else f"sudo {command}" for command in cure(missing)]
    if not commands:
        named = ", ".join(packages_of(missing, 0))
        print(f"{wanted}: install with your package manager what Debian calls {named}", file=sys.stderr)
        return 1
    line = " && ".join(commands)
    if not (root or "--yes" in arguments):
        print(f"{wanted}; this installs them (or make test YES=1): {line}", file=sys.stderr)
        return 1
    print(f"{wanted}; installing them: {line}", file=sys.stderr, flush=True)
    if install(commands):
        print("That failed: see above.", file=sys.stderr)
        return 1
    if left := missing_parts():
        print(f"Still missing: {', '.join(left)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
