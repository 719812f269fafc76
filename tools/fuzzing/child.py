"""The process that reads: it says before each input that it begins, so that its death tells which it was.

It is told a line "FORMAT FIRST AFTER_LAST" at a time, and answers in lines of JSON.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import importlib
import json
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TextIO

from PIL import Image

from r2sego_blender.core.errors import R2SEgoError

from . import guarding
from .harness import Harness
from .mutations.text import OUTSIDE
from .oracle import fault_of

CLASSES = ("refused", "clean", "traceback", "death", "hang", "memory", "slow", "badaccept", "escape", "message")
"""What may become of an input."""

RIGHT = CLASSES[:2]

SLOW_S = 1.0
"""For a refusal; where the reader starts a process, on top of what it takes for the right input."""

_STARTS_S = 0.3

LONGEST_READING_S = 5.0
"""For what is accepted: a large picture and a detailed mesh take their time."""

LARGEST_GROWTH_MB = 200.0
_MOST_TIMES_FILE = 10
_PIXEL_BYTES, _MOST_PIXELS = 16, 50_000_000  # of a picture: three values of 32 bits, and what it is made from
_ADDRESS_SPACE = 16 << 30
_LONGEST_MESSAGE = 2000
_TRIES = 3  # other work on the machine makes a reader slow now and then


class Reader:
    """Reads inputs of any format in a folder of this process's own, in seconds of ``clock``."""

    def __init__(self, folder: Path, clock: Callable[[], float] = time.perf_counter) -> None:
        self.folder, self._clock = folder, clock
        self._built: dict[Any, Path] = {}
        self._right_s: dict[str, float] = {}

    def place(self, harness: Harness) -> Path:
        """The folder with a format's right input, in which one file is changed."""
        if harness.build not in self._built:
            place = self.folder / f"in_{len(self._built)}"
            place.mkdir(parents=True)
            harness.build(place)
            self._built[harness.build] = place
        return self._built[harness.build]

    @contextlib.contextmanager
    def changing(self, harness: Harness) -> Iterator[tuple[Path, bytes]]:
        """The file that is changed, and its right bytes, which it has again afterwards.

        Raises ValueError where these are not accepted: the harness is wrong then.
        """
        file = self.place(harness) / harness.file
        data = file.read_bytes()
        try:
            if harness.name not in self._right_s:
                found = [self.outcome(harness) for _ in range(2)][-1]  # the first imports what it needs
                if found["class"] not in ("clean", "slow"):
                    raise ValueError(f"{harness.name}: the right input is not accepted: {found}")
                self._right_s[harness.name] = found["s"]
            yield file, data
        finally:
            file.write_bytes(data)

    def outcome(self, harness: Harness, begin: Callable[[], None] = lambda: None) -> dict[str, Any]:
        """What becomes of the file as it is: its class, and what is to be said of it.

        ``begin`` is called before each reading of it.
        """
        begin()
        found = self._once(harness)
        for _ in range(_TRIES - 1):
            if found["class"] not in ("slow", "memory"):
                break
            begin()
            again = self._once(harness)
            found = again if again["class"] not in ("slow", "memory") else {**again, "s": min(found["s"], again["s"])}
        return found

    def _start_s(self, harness: Harness) -> float:
        """What its reader takes to start a process, seconds: nothing for those that start none."""
        right_s = self._right_s.get(harness.name, 0.0)
        return right_s if right_s > _STARTS_S else 0.0

    def _once(self, harness: Harness) -> dict[str, Any]:
        place = self.place(harness)
        size = (place / harness.file).stat().st_size
        pixels = _declared_pixels(place / harness.file) if harness.is_picture else 0
        gc.collect(0)
        before, grandchildren = _reset_peak_mb(), _children_peak_mb()
        began = self._clock()
        kind, text = "clean", ""
        with guarding.watched(place) as escapes:
            try:
                text = fault_of(harness.read(place))
                kind = "badaccept" if text else "clean"
            except R2SEgoError as error:
                kind, text = "refused", str(error)
                if fault := _fault_of_message(error):
                    kind, text = "message", f"{fault}: {text}"
            except MemoryError as error:
                kind, text = "memory", f"MemoryError {error}"
            except Exception as error:
                kind, text = "traceback", _last_frame(error)
        seconds = self._clock() - began
        grown = max(_peak_mb() - before, _children_peak_mb() - grandchildren)
        if kind in ("clean", "refused", "message"):
            if escapes:
                kind, text = "escape", escapes[0]
            elif grown > max(LARGEST_GROWTH_MB, _MOST_TIMES_FILE * size / 1e6, _PIXEL_BYTES * pixels / 1e6):
                kind = "memory"
            elif seconds > (LONGEST_READING_S if kind == "clean" else SLOW_S) + self._start_s(harness):
                kind = "slow"
        return {"class": kind, "text": text[:400], "s": round(seconds, 3), "mb": round(grown)}


def processor_s() -> float:
    """What this process and those that it started and that ended have taken of processors, seconds."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _reset_peak_mb() -> float:
    """Let the peak of memory begin anew, and say what is held now, MB."""
    Path("/proc/self/clear_refs").write_text("5")
    return _peak_mb()


def _peak_mb() -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) / 1024
    return 0.0


def _children_peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def _declared_pixels(file: Path) -> int:
    """How many pixels a picture says that it has; 0 for what is none."""
    try:
        with warnings.catch_warnings(), Image.open(file) as image:
            warnings.simplefilter("ignore")
            return min(image.width * image.height, _MOST_PIXELS)
    except Exception:  # of Pillow's many kinds
        return 0


def _fault_of_message(error: R2SEgoError) -> str:
    text = str(error)
    if len(text) > _LONGEST_MESSAGE:
        return f"{len(text)} characters"
    if any(unicodedata.category(one) == "Cc" and one != "\n" for one in text):
        return "control characters"
    if not error.where or not error.cure:
        return "no file" if not error.where else "no cure"
    return ""


def _last_frame(error: BaseException) -> str:
    """The error and where in the library it was raised."""
    frames = [one for one in traceback.extract_tb(error.__traceback__) if "r2sego_blender" in one.filename]
    at = f" @ {frames[-1].filename.rpartition('r2sego_blender/')[2]}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}: {str(error)[:200]}{at}"


def run(answers: TextIO, folder: Path, seed: int, harnesses: Sequence[Harness]) -> None:
    """Do what the standard input tells, until it ends."""
    reader, named = Reader(folder), {harness.name: harness for harness in harnesses}

    def tell(**said: Any) -> None:
        answers.write(json.dumps(said) + "\n")
        answers.flush()

    for line in sys.stdin:
        name, first, after = line.split()
        try:
            with reader.changing(named[name]) as (file, data):
                tell(ready=name, file=str(file))
                for number in range(int(first), int(after)):
                    content, change = named[name].changed(data, seed, number)
                    file.write_bytes(content)
                    begin = partial(tell, begins=number, change=change[:200])
                    outcome = reader.outcome(named[name], begin)
                    if outcome["class"] not in RIGHT:  # the next input takes its place before this one is looked at
                        kept = folder / f"kept_{number}"
                        kept.write_bytes(content)
                        outcome["kept"] = str(kept)
                    tell(number=number, change=change[:200], bytes=len(content), **outcome)
        except Exception:  # of the harness: what readers raise is an outcome
            tell(wrong=traceback.format_exc(limit=-6))
        tell(done=name)


def main() -> None:
    """Run with the seed, a folder and the module of the harnesses; answers go where the standard output did."""
    faulthandler.enable()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what readers print is none
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder = Path(sys.argv[2])
    Path(OUTSIDE).parent.mkdir(exist_ok=True)
    tempfile.tempdir = str(folder)
    try:
        run(answers, folder, int(sys.argv[1]), importlib.import_module(sys.argv[3]).HARNESSES)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
