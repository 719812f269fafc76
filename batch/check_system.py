"""Stop at once when a system library that pip's bpy needs is missing, and name the cure.

Needs only the standard library, so that it can run before anything is installed:

    python3 batch/check_system.py            exit 0, or 1 and the one line that cures it
    python3 batch/check_system.py --packages  the missing packages alone, for a script
"""

from __future__ import annotations

import ctypes
import shutil
import sys
from collections.abc import Callable

# What `ldd` of bpy 4.5's library names beyond the C runtime and its own folder:
# library -> package on (Debian and Ubuntu, Fedora, Arch).
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
}

INSTALLERS = (
    ("apt-get", "apt-get install -y"),
    ("dnf", "dnf install -y"),
    ("pacman", "pacman -S --noconfirm"),
)


def missing_libraries(load: Callable[[str], object] = ctypes.CDLL) -> list[str]:
    """The libraries of ``LIBRARIES`` that ``load`` cannot open; none off Linux."""
    if not sys.platform.startswith("linux"):
        return []
    missing = []
    for library in LIBRARIES:
        try:
            load(library)
        except OSError:
            missing.append(library)
    return missing


def cure(missing: list[str], which: Callable[[str], object] = shutil.which) -> tuple[str, list[str]]:
    """The package manager's install command of this machine, and the packages it lacks."""
    for column, (program, command) in enumerate(INSTALLERS):
        if which(program):
            return command, [LIBRARIES[library][column] for library in missing]
    return "install with your package manager:", [LIBRARIES[library][0] for library in missing]


def main(arguments: list[str]) -> int:
    missing = missing_libraries()
    if not missing:
        return 0
    command, packages = cure(missing)
    if "--packages" in arguments:
        print(" ".join(packages))
        return 1
    print(
        f"Blender's Python module needs system libraries that are missing: {', '.join(missing)}",
        file=sys.stderr,
    )
    print(f"Run this, then start again:\n\n    sudo {command} {' '.join(packages)}\n", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
