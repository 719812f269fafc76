"""Readers that do what a reader must not, by the first byte of their file."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

import numpy as np

from r2sego_blender.core.errors import SceneError
from tools.fuzzing import harness as fuzzing
from tools.fuzzing.mutations.text import OUTSIDE

RIGHT_WAYS = ("clean", "own", "refused")
WRONG_WAYS = ("traceback", "death", "hang", "memory", "slow", "badaccept", "escape", "message", "no cure")
WAYS = (*RIGHT_WAYS, *WRONG_WAYS)


def _read(folder: Path) -> object:
    file = folder / "a.txt"
    match file.read_text():
        case "refused":
            raise SceneError("it is damaged", where=file, cure="Make it anew.")
        case "own":  # it is called as what lies outside, and lies beside the file
            with contextlib.suppress(FileNotFoundError):
                Path(f"{folder}/{OUTSIDE}").read_text()
        case "traceback":
            raise KeyError("a")
        case "death":
            os.abort()
        case "hang":
            time.sleep(60.0)
        case "memory":
            np.ones(300 << 20, np.uint8)
        case "slow":
            time.sleep(1.2)
            raise SceneError("it is damaged", where=file, cure="Make it anew.")
        case "badaccept":
            return {"a": [1.0, float("nan")]}
        case "escape":
            with contextlib.suppress(FileNotFoundError):
                Path(f"{OUTSIDE}.txt").read_text()
        case "message":
            raise SceneError("it is damaged", cure="Make it anew.")
        case "no cure":
            raise SceneError("it is damaged", where=file)
    return 1.0


def _build(folder: Path) -> None:
    (folder / "a.txt").write_text("clean")


class _InTurn(fuzzing.Harness):
    def changed(self, data: bytes, seed: int, number: int) -> tuple[bytes, str]:
        return WAYS[number].encode(), WAYS[number]


HARNESSES = (_InTurn("misbehaving", _build, "a.txt", "text", _read),)
