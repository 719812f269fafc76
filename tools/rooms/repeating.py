"""Rooms whose walls repeat themselves, to solve photographs of without poses: one wall looks like another.

    python -m tools.rooms.repeating --to DIR
    r2sego bench solving DIR/dining_checks --poses DIR/dining_checks/walk.json --count 15

Each is a development room of another seed with checks or stripes on its walls; fifteen photographs around it, whose
poses ``walk.json`` has in the order of the walk.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

from .benchmark import BenchmarkRoom, make_room, parse_options
from .furnished.development_styles import DINING, STUDY, WARM
from .furnished.style import Style

_CHECKS, _STRIPES = ("checks", ("#cdd8c4", "#e8efe2")), ("stripes", ("#c4b59a", "#e9dfcc"))
_PHOTOGRAPHS = "15"


def _papered(base: Style, name: str, wall: tuple, accent: tuple, seed: int) -> BenchmarkRoom:
    return BenchmarkRoom(dataclasses.replace(base, name=name, wall=wall, accent=accent), seed, 1.0, 90.0)


ROOMS = (
    _papered(DINING, "dining_checks", _CHECKS, _STRIPES, 3),
    _papered(WARM, "warm_stripes", _STRIPES, _CHECKS, 5),
    _papered(STUDY, "study_checks", _CHECKS, _CHECKS, 7),
)


def main() -> None:
    """Make the rooms; pictures that are there are not rendered again."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--to", type=Path, required=True, help="the folder of the rooms' folders")
    folder = parser.parse_args().to
    options = parse_options(["--to", str(folder), "--sets", _PHOTOGRAPHS])
    for room in ROOMS:
        make_room(room, folder / room.name, options)
        cameras = json.loads((folder / room.name / "cameras.json").read_text(encoding="utf-8"))
        walk = cameras | {"captures": sorted(cameras["captures"], key=lambda entry: entry["file"])}
        (folder / room.name / "walk.json").write_text(json.dumps(walk, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
