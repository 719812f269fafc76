"""Try readers with changed inputs.

    python -m tools.fuzzing mutate [--count N] [--seed S] [--format NAME ...] [--to FOLDER] [--again]
    python -m tools.fuzzing guided [FORMAT ...] [--seconds N] [--processes N] [--again | --record]

``mutate`` reads seeded inputs of every format and ends with a table, and with status 1 where one of them
is anything but refused or accepted with clean values. ``guided`` has atheris look for inputs that reach
further into a reader (``pip install -e .[fuzz]``, Python 3.11).
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .formats import HARNESSES
from .guided import guide
from .harness import Harness
from .ledger import forget, least_searched, record, searched
from .mutate import mutate, table


def _chosen(names: Sequence[str]) -> list[Harness]:
    """The formats of these names, or that begin so; all without any. Ends the command where there is none."""
    chosen = [one for one in HARNESSES if not names or one.name.startswith(tuple(names))]
    if not chosen:
        sys.exit(f"there is no format {', '.join(names)}; `python -m tools.fuzzing formats` lists them")
    return chosen


def _guided(given: argparse.Namespace) -> int:
    if importlib.util.find_spec("atheris") is None:
        sys.exit("atheris is not installed here: pip install -e .[fuzz], under Python 3.11")
    names = [one.name for one in _chosen(given.format)]
    asked = least_searched(names, given.seconds) if given.record else dict.fromkeys(names, given.seconds)

    def search(name: str) -> tuple[int, int]:
        runs, failing = guide(name, asked[name], given.to, given.again)
        told = "nothing was tried: see the log" if not runs else f"{runs} inputs, {failing} kinds of failing ones"
        print(f"{name}: {told} in {given.to}", flush=True)
        if given.record and failing:
            forget(name)
        elif given.record and runs:
            record(name, asked[name], runs)
        return runs, failing

    with ThreadPoolExecutor(given.processes) as pool:
        found = list(pool.map(search, asked))
    return 1 if any(failing or not runs for runs, failing in found) else 0


def main() -> None:
    """The command; it ends with status 1 where an input fails."""
    parser = argparse.ArgumentParser(prog="tools.fuzzing", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    changed = commands.add_parser("mutate", help="seeded changes of every format")
    changed.add_argument("--count", type=int, default=10_000, help="inputs over all formats")
    changed.add_argument("--seed", type=int, default=0)
    changed.add_argument("--format", nargs="+", default=[], help="formats, or how their names begin; all without it")
    changed.add_argument("--to", type=Path, default=Path("build/fuzzing"), help="where failing inputs go")
    changed.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    changed.add_argument("--again", action="store_true", help="go on where a run into the folder was ended")
    guided = commands.add_parser("guided", help="coverage-guided, a format at a time")
    guided.add_argument("format", nargs="*", help="formats, or how their names begin; all without any")
    guided.add_argument("--seconds", type=int, default=600, help="of processor time for each")
    guided.add_argument("--processes", type=int, default=1, help="formats at a time")
    guided.add_argument("--to", type=Path, default=Path("build/fuzzing_guided"))
    counted = guided.add_mutually_exclusive_group()
    counted.add_argument("--again", action="store_true", help="count what earlier runs into the folder searched")
    counted.add_argument("--record", action="store_true", help="count what searched.json has, and add to it")
    commands.add_parser("formats", help="list the formats, and for how long each was searched")
    given = parser.parse_args()
    if given.command == "formats":
        done = searched()
        for one in HARNESSES:
            print(f"{one.name:40}{done[one.name].seconds:6} s" if one.name in done else one.name)
    elif given.command == "guided":
        sys.exit(_guided(given))
    else:
        chosen = _chosen(given.format)
        tally = mutate(given.count, given.seed, chosen, given.to, given.processes, given.again)
        print(table(tally))
        for told in tally.wrong:
            print(told)
        print(f"{tally.failed} failed" + (f", see {given.to}/INDEX.txt" if tally.failed else ""))
        sys.exit(1 if tally.failed or tally.wrong else 0)


if __name__ == "__main__":
    main()
