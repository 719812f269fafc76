"""Run the scenes of the README's table, from photographs to scores.

    python -m tools.results.measure --data ../shared --to build [--scene room_a ...] [--preset preview]

``--data`` is a folder with ``scenes/room_a``, ``captures/holo_office`` and ``captures/tum_desk``
as the README names them. What is held out was fixed by index before any result was seen and
is never an input. Afterwards ``python -m tools.results.table --write build/*.r2s`` writes the table.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HOLO_INPUTS = range(40, 63, 2)
HOLO_HELD_OUT = range(41, 62, 2)
TUM_HELD_OUT = (3, 7, 11, 15)


@dataclass(frozen=True)
class Split:
    """Photographs to import, their poses if any are known, and the held-out views."""

    captures: Path
    poses: Path | None
    frozen: Path


def room_a(data: Path, work: Path) -> Split:
    """A rendered room: six captures, sixteen frozen robot views, both with poses."""
    folder = data / "scenes" / "room_a"
    return Split(folder / "captures", folder / "cameras.json", folder / "cameras.json")


def holo_office(data: Path, work: Path) -> Split:
    """An office with poses: even frames 40 to 62 are captures, the odd ones between are held out."""
    folder = data / "captures" / "holo_office"
    lens = np.loadtxt(folder / "K.txt")
    poses = np.loadtxt(folder / "poses_c2w.txt").reshape(-1, 4, 4)
    photographs = sorted((folder / "images").iterdir())

    copies = _emptied(work / "holo_office_photographs")

    def entries(indices: range) -> list[dict]:
        for i in indices:
            shutil.copy(photographs[i], copies)
        return [{"file": photographs[i].name, "world_from_camera": poses[i].tolist()} for i in indices]

    cameras = {
        "about": "holo_office, split by index",
        "metric": True,
        "width": 540,
        "height": 360,
        "fx": lens[0, 0],
        "fy": lens[1, 1],
        "cx": lens[0, 2],
        "cy": lens[1, 2],
        "captures": entries(HOLO_INPUTS),
        "frozen": entries(HOLO_HELD_OUT),
    }
    file = copies / "cameras.json"
    file.write_text(json.dumps(cameras, indent=1) + "\n")
    return Split(copies, file, file)


def tum_desk(data: Path, work: Path) -> Split:
    """A desk without poses: four of the seventeen photographs are held out and located."""
    inputs, held_out = _emptied(work / "tum_desk_inputs"), _emptied(work / "tum_desk_held_out")
    photographs = sorted((data / "captures" / "tum_desk").glob("*.png"))
    for index, photograph in enumerate(photographs):
        shutil.copy(photograph, held_out if index in TUM_HELD_OUT else inputs)
    return Split(inputs, None, held_out)


SCENES: dict[str, Callable[[Path, Path], Split]] = {"room_a": room_a, "holo_office": holo_office, "tum_desk": tum_desk}


def measure(name: str, data: Path, work: Path, preset: str) -> None:
    """New, refine and evaluate; a scene that was begun goes on where it stopped."""
    split = SCENES[name](data, work)
    scene = str(work / f"{name}.r2s")
    poses = ["--poses", str(split.poses)] if split.poses else []
    if not Path(scene).exists():
        run_r2sego("new", scene, "--captures", str(split.captures), *poses)
    run_r2sego("refine", scene, "--preset", preset)
    run_r2sego("evaluate", scene, "--frozen", str(split.frozen))


def _emptied(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


def run_r2sego(*arguments: str | Path) -> None:
    """Run one of the program's commands, whose words are shown; ends this process where it fails."""
    print(f"$ r2sego {' '.join(map(str, arguments))}", flush=True)
    status = subprocess.run([sys.executable, "-m", "r2sego_blender", *map(str, arguments)]).returncode
    if status:  # it has said why
        sys.exit(status)


def main() -> None:
    """Measure the chosen scenes, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder of scenes/ and captures/")
    parser.add_argument("--to", type=Path, required=True, help="folder for the bundles")
    parser.add_argument("--scene", action="append", choices=list(SCENES), help="default: all")
    parser.add_argument("--preset", default="preview")
    arguments = parser.parse_args()
    arguments.to.mkdir(parents=True, exist_ok=True)
    for name in arguments.scene or SCENES:
        measure(name, arguments.data, arguments.to, arguments.preset)


if __name__ == "__main__":
    main()
