"""Take the pictures of Blender's window, docs/pictures/blender_*.jpg, from the refined demo room:

BLENDER=/path/to/blender python -m tools.pictures.blender build/demo_room.r2s [NAME ...]

The window stands on a display of its own, as in the window tests, with the add-on as it is now.
``arrange_blender.py`` arranges each picture inside Blender; names choose some of its PICTURES. That of a policy
needs `r2sego policy evaluate SCENE --policy FOLDER --record SCENE/robot/policy` before.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PICTURES = HERE.parents[1] / "docs" / "pictures"
sys.path.insert(0, str(HERE.parents[1] / "tests" / "window"))
import display  # noqa: E402  found in the window tests

ALL = ("proxy", "support_gap", "splats", "wipe", "policy")
SIZE_PX = (1400, 900)
MOST_KB = 150


def take(bundle: Path, names: list[str]) -> None:
    """Each picture in a Blender of its own; ``bundle`` itself is only read."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        package = display.build_zip(work / "zip")
        copy = work / "demo_room.r2s"
        shutil.copytree(bundle, copy)
        rounds = sum(1 for place in (copy / "rounds").iterdir() if (place / "proxy").is_dir())
        if not (copy / "rounds" / str(rounds - 1) / "coverage").is_dir():
            coverage = [sys.executable, "-m", "r2sego_blender", "coverage", str(copy), "--round"]
            subprocess.run([*coverage, str(rounds - 1)], check=True)
        for name in names:
            out = work / name
            arguments = (str(package), str(copy), sys.executable, name)
            log = display.run(HERE / "arrange_blender.py", out, *arguments, size=SIZE_PX)
            taken = out / f"{name}.png"
            if not taken.is_file() or "Traceback" in log:
                raise SystemExit(f"{name}: {log[-3000:]}")
            save(taken, PICTURES / f"blender_{name}.jpg")


def save(picture: Path, to: Path) -> None:
    """As a JPEG file of at most MOST_KB."""
    size = f"jpeg:extent={MOST_KB}KB"
    subprocess.run(["convert", str(picture), "-strip", "-define", size, str(to)], check=True)
    print(f"{to.name}: {to.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    if missing := display.missing():
        raise SystemExit(missing)
    take(Path(sys.argv[1]).resolve(), sys.argv[2:] or list(ALL))
