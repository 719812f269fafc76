"""Refine the demo room with the three commands a person would type, and time them.

python demo/run_demo.py build/demo_room.r2s
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

ROOM = Path(__file__).resolve().parent / "room"


def commands(scene: Path) -> list[list[str]]:
    """The command lines of the demo; ``new`` is left out when the scene is there already."""
    cameras = str(ROOM / "cameras.json")
    new = ["new", str(scene), "--captures", str(ROOM / "captures"), "--poses", cameras]
    refine = ["refine", str(scene), "--preset", "preview"]
    evaluate = ["evaluate", str(scene), "--frozen", cameras]
    return [refine, evaluate] if scene.exists() else [new, refine, evaluate]


def main(scene: Path) -> int:
    started_s = time.monotonic()
    scene.parent.mkdir(parents=True, exist_ok=True)
    for arguments in commands(scene):
        print(f"\n$ r2sego {' '.join(arguments)}", flush=True)
        status = subprocess.run([sys.executable, "-m", "r2sego_blender", *arguments]).returncode
        if status:
            return status
    print(f"scene:  {scene.resolve()}")
    print(f"took:   {time.monotonic() - started_s:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/demo_room.r2s")))
