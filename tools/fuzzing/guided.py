"""Coverage-guided search for inputs that one reader fails on, with atheris.

Only the library is instrumented, without the files that Numba compiles. ``guide`` starts this file as a
program, and again where an input ended it.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

_ROOT = Path(__file__).parents[2]
_SEEDS = 200
_TOLD = ".told"
_COMPILED = re.compile(r"\bnumba\b|compiled import")
_RUNS = re.compile(r"^stat::number_of_executed_units:\s*(\d+)", re.MULTILINE)
_LONGEST_BYTES = 1 << 19
_LONGEST_CHANGED = 1 << 16  # what is changed again and again grows without an end
_HANG_S = 20  # of processor time: beside other work a reading may take a minute
_WAITS_S = 600  # for nothing
_TRIED = "tried"
_SLOW_S = 5.0  # instrumented code takes some times longer
_MOST_MB = 4000


def guide(
    name: str,
    seconds: int,
    folder: Path,
    again: bool = False,
    *,
    hang_s: int = _HANG_S,
    formats: str = "tools.fuzzing.formats",
) -> tuple[int, int]:
    """Search for so many seconds of processor time; how many inputs were tried, how many kinds of failing ones
    ``folder`` has.

    With ``again`` what earlier runs into the folder searched counts. An input that is read for ``hang_s`` of
    processor time is a failing one. ``formats`` is the module of the harnesses.
    """
    place = folder.absolute() / name.replace("/", "_")
    failing, corpus, searched = place / "failing", place / "corpus", place / "searched_s"
    if not again:
        shutil.rmtree(failing, ignore_errors=True)
        (place / "log").unlink(missing_ok=True)
        searched.unlink(missing_ok=True)
    for one in (failing, corpus):
        one.mkdir(parents=True, exist_ok=True)
    before_s = float(searched.read_text(encoding="utf-8")) if searched.is_file() else 0.0
    while (left := int(seconds - before_s)) > 0:
        with tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None) as scratch:
            command = [
                sys.executable,
                "-m",
                "tools.fuzzing.guided",
                formats,
                name,
                f"{hang_s}",
                f"{failing}",
                f"{corpus}",
            ]
            options = [f"-max_total_time={left}", f"-max_len={_LONGEST_BYTES}", f"-timeout={_WAITS_S}"]
            options += [
                f"-rss_limit_mb={_MOST_MB}",
                f"-artifact_prefix={failing}/",
                "-detect_leaks=0",
                f"-report_slow_units={_WAITS_S}",
                "-print_final_stats=1",
            ]
            with (place / "log").open("ab") as log:
                environment = os.environ | {"TMPDIR": scratch}
                child = subprocess.Popen([*command, *options], cwd=_ROOT, env=environment, stderr=log, stdout=log)
                before_s += _ended_s(child)
            if child.returncode == -signal.SIGPROF:
                _keep_hang(Path(scratch, _TRIED), failing)
        searched.write_text(f"{before_s:.1f}\n", encoding="utf-8")
    runs = sum(map(int, _RUNS.findall((place / "log").read_text(errors="replace"))))
    return runs, sum(file.suffix != _TOLD for file in failing.iterdir())


def _ended_s(child: subprocess.Popen[bytes]) -> float:
    """The seconds of processor time that it took; at least one, so that a search that cannot begin ends."""
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return max(1.0, used.ru_utime + used.ru_stime)


def _keep_hang(tried: Path, failing: Path) -> None:
    """Put the input that was being read among the failing ones."""
    content = tried.read_bytes()
    (failing / f"hang-{hashlib.sha1(content).hexdigest()}{tried.resolve().suffix}").write_bytes(content)


def main() -> None:
    """The program: harnesses' module, a format, what a reading may take, folders for failing inputs and the corpus, and
    libFuzzer's options."""
    import atheris

    formats, name, hang_s, failing, corpus, *options = sys.argv[1:]
    compiled = [
        ".".join(file.relative_to(_ROOT).with_suffix("").parts)
        for file in (_ROOT / "r2sego_blender").rglob("*.py")
        if _COMPILED.search(file.read_text(encoding="utf-8"))
    ]
    with atheris.instrument_imports(include=["r2sego_blender"], exclude=compiled):
        from .child import RIGHT, Reader, processor_s
        from .harness import Harness
        from .mutate import fault_key

        harnesses: tuple[Harness, ...] = importlib.import_module(formats).HARNESSES
        harness = next(one for one in harnesses if one.name == name)
        reader = Reader(Path(tempfile.gettempdir()), processor_s)  # beside other work all are slow by the clock
        place = reader.place(harness) / harness.file
        Path(tempfile.gettempdir(), _TRIED).symlink_to(place)
        data = place.read_bytes()
        reader.outcome(harness)  # what is imported as it reads is instrumented, too
    if not any(Path(corpus).iterdir()):
        for number in range(_SEEDS):
            content = harness.changed(data, 0, number)[0] if number else data
            if len(content) <= _LONGEST_BYTES:
                Path(corpus, f"seed_{number:03d}").write_bytes(content)

    def try_one(content: bytes) -> None:
        place.write_bytes(content)
        signal.setitimer(signal.ITIMER_PROF, float(hang_s))  # which ends this process: ``guide`` looks for its signal
        outcome = reader.outcome(harness)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if outcome["class"] not in RIGHT and not (outcome["class"] == "slow" and outcome["s"] < _SLOW_S):
            file = Path(failing, f"{outcome['class']}-{fault_key(name, outcome | {'bytes': 0})}{place.suffix}")
            if not file.exists() or file.stat().st_size > len(content):
                file.write_bytes(content)
                file.with_name(file.name + _TOLD).write_text(json.dumps(outcome))

    def changed(content: bytes, longest: int, seed: int) -> bytes:
        random = Random(seed)
        if len(content) <= _LONGEST_CHANGED and random.random() < 0.5:
            try:
                new = harness.changed(content, seed, 0)[0]
            except Exception:  # it is no more of a kind that has a structure
                new = b""
            if 0 < len(new) <= longest:
                return new
        result: bytes = atheris.Mutate(content, longest)
        return result

    atheris.Setup([sys.argv[0], corpus, *options], try_one, custom_mutator=changed)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
