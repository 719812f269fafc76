"""A reader that never ends with anything but what it knows."""

from __future__ import annotations

from pathlib import Path

from tools.fuzzing.harness import Harness


def _build(folder: Path) -> None:
    (folder / "a.txt").write_text("right")


def _read(folder: Path) -> float:
    while (folder / "a.txt").read_bytes() != b"right":
        pass
    return 1.0


HARNESSES = (Harness("spinning", _build, "a.txt", "text", _read),)
