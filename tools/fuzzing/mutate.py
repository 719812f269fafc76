"""Many changed inputs of every format, what became of them in a table, and those that failed in a folder."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, Queue
from threading import Lock
from typing import Any

from .child import CLASSES, RIGHT
from .children import Child
from .harness import Harness

_CHUNK = 250
_VARYING = re.compile(r"0x[0-9a-f]+|\d+|'[^']{0,80}'|/\S+")


@dataclass
class Tally:
    """What became of inputs so far: by format the classes' counts, and by format and fault the failures.

    ``wrong`` says of formats why they could not be tried at all.
    """

    counts: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    slowest_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    largest_mb: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    failures: dict[str, dict[str, Any]] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def add(self, name: str, outcome: dict[str, Any]) -> bool:
        """Count an outcome; whether it is a failure smaller than any of its kind before."""
        kind = outcome["class"]
        self.counts[name][kind] += 1
        self.slowest_s[name] = max(self.slowest_s[name], outcome["s"])
        self.largest_mb[name] = max(self.largest_mb[name], outcome["mb"])
        if kind in RIGHT:
            return False
        fault = fault_key(name, outcome)
        known = self.failures.get(fault)
        count = (known["count"] if known else 0) + 1
        smaller = known is None or outcome["bytes"] < known["bytes"]
        self.failures[fault] = {**(outcome if smaller else known or outcome), "count": count, "format": name}
        return smaller

    @property
    def failed(self) -> int:
        """The inputs of which something else became than a refusal or clean values."""
        return sum(count for counts in self.counts.values() for kind, count in counts.items() if kind not in RIGHT)


def fault_key(name: str, outcome: dict[str, Any]) -> str:
    """What failures of one cause have in common."""
    text = outcome["text"].split("\n")[0] if outcome["class"] in ("traceback", "badaccept", "death", "escape") else ""
    told = f"{name}|{outcome['class']}|{_VARYING.sub('#', text)[:160]}"
    return hashlib.sha256(told.encode()).hexdigest()[:8]


def planned(count: int, formats: Sequence[Harness]) -> list[tuple[Harness, int, int]]:
    """``count`` inputs over the formats by their shares, in parts: (format, first, after the last)."""
    shares = sum(one.share for one in formats)
    parts = []
    for one in formats:
        wanted = max(1, round(count * one.share / shares))
        parts += [(one, first, min(first + _CHUNK, wanted)) for first in range(0, wanted, _CHUNK)]
    return sorted(parts, key=lambda part: part[1])


def mutate(count: int, seed: int, formats: Sequence[Harness], folder: Path, processes: int, again: bool) -> Tally:
    """Try ``count`` inputs; failing ones go to ``folder``, with a line each in ``INDEX.txt``.

    Parts that were finished stand in ``parts.jsonl`` there: with ``again`` they are not tried anew.
    """
    if not again:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "parts.jsonl"
    tally, known = _known(log)
    parts = [part for part in planned(count, formats) if f"{seed} {part[0].name} {part[1]} {part[2]}" not in known]
    queue: Queue[tuple[Harness, int, int]] = Queue()
    for part in parts:
        queue.put(part)
    lock, began, left = Lock(), time.monotonic(), len(parts)

    def work() -> None:
        nonlocal left
        with Child(seed) as child:
            while True:
                try:
                    harness, first, after = queue.get_nowait()
                except Empty:
                    return
                outcomes = []
                try:
                    for outcome, file in child.outcomes(harness.name, first, after):
                        outcomes.append(outcome)
                        with lock:
                            if tally.add(harness.name, outcome):
                                _keep(folder, harness.name, outcome, file)
                except RuntimeError as error:
                    tally.wrong.append(str(error))
                    child.end()
                    continue
                with lock:
                    left -= 1
                    key = f"{seed} {harness.name} {first} {after}"
                    with log.open("a") as stream:
                        stream.write(json.dumps({"part": key, "outcomes": _shortened(outcomes)}) + "\n")
                    bad = sum(one["class"] not in RIGHT for one in outcomes)
                    told = f"{time.monotonic() - began:6.0f} s, {left} parts left: {harness.name} {first}..{after}"
                    print(f"{told}, {bad} failed" if bad else told, file=sys.stderr, flush=True)

    with ThreadPoolExecutor(processes) as pool:
        for done in [pool.submit(work) for _ in range(processes)]:
            done.result()
    write_index(folder, tally)
    return tally


def table(tally: Tally) -> str:
    """The counts of each format, a line each, and those of all."""
    columns = [kind for kind in CLASSES if kind in RIGHT or any(counts[kind] for counts in tally.counts.values())]
    rows = [["format", "inputs", *columns, "slowest s", "most MB"]]
    for name in sorted(tally.counts):
        counts = tally.counts[name]
        figures = [f"{tally.slowest_s[name]:.2f}", f"{tally.largest_mb[name]:.0f}"]
        rows.append([name, str(counts.total()), *(str(counts[kind] or "-") for kind in columns), *figures])
    whole = sum(tally.counts.values(), Counter[str]())
    rows.append(["all", str(whole.total()), *(str(whole[kind] or "-") for kind in columns), "", ""])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)


def write_index(folder: Path, tally: Tally) -> None:
    """A line for each failure: format, how often, class, what, mutation, size, memory and time, file."""
    lines = []
    for key, one in sorted(tally.failures.items(), key=lambda item: (item[1]["format"], item[1]["class"])):
        place = _place(one["format"], key, one)
        what = one["text"].replace("\n", " ")[:200]
        figures = f"{one['bytes']} bytes | +{one['mb']} MB {one['s']} s"
        line = (
            f"{one['format']} | {one['count']}x | {one['class']} | {what} | mutation: {one['change'][:80]} | {figures}"
        )
        lines.append(ascii(f"{line} | input {one['number']} | {place}")[1:-1])
    (folder / "INDEX.txt").write_text("\n".join([*lines, ""]))


def _known(log: Path) -> tuple[Tally, set[str]]:
    tally, known = Tally(), set()
    for line in log.read_text().splitlines() if log.is_file() else ():
        part = json.loads(line)
        known.add(part["part"])
        name = part["part"].split()[1]
        for outcome in part["outcomes"]:
            if "class" in outcome:
                tally.add(name, outcome)
            else:
                tally.counts[name].update(outcome["counts"])
                tally.slowest_s[name] = max(tally.slowest_s[name], outcome["s"])
                tally.largest_mb[name] = max(tally.largest_mb[name], outcome["mb"])
    return tally, known


def _shortened(outcomes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The failures, and of the others their number alone."""
    right = [one for one in outcomes if one["class"] in RIGHT]
    counts = {
        "counts": Counter(one["class"] for one in right),
        "s": max((one["s"] for one in right), default=0.0),
        "mb": max((one["mb"] for one in right), default=0),
    }
    return [counts, *(one for one in outcomes if one["class"] not in RIGHT)]


def _place(name: str, key: str, outcome: dict[str, Any]) -> str:
    plain = name.replace("/", "_")
    return f"{plain}/{key}-{outcome['class']}{Path(name).suffix}"


def _keep(folder: Path, name: str, outcome: dict[str, Any], file: Path) -> None:
    place = folder / _place(name, fault_key(name, outcome), outcome)
    place.parent.mkdir(exist_ok=True)
    shutil.copy(file, place)
