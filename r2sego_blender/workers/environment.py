"""Make the engine's environment: ``python -m r2sego_blender.workers.environment FOLDER``.

Needs nothing but the standard library, so Blender's own Python runs it. Packages come from
the package index, or from a folder of wheels on a machine without a network: exactly those of the
lock in ``requirements/``, each file by its hash. torch is installed before all others and alone, so
that none of them is looked for in the index that has its small build. What was downloaded is kept
until all is installed, so a second try fetches only what is missing. Progress is told as the engine
tells it, in JSON lines.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from ..core.errors import MachineError, R2SEgoError, of_file
from ..core.progress import JsonProgress, Progress
from ..core.text_files import write_text
from .processes import DYING_WITH_PARENT

LOCK = Path(__file__).resolve().parents[2] / "requirements"
"""The packages by version and hash: ``torch.txt`` and ``engine.txt``, of ``batch/lock_packages.py``."""

DOWNLOADS = ".downloads"
"""Where an environment that is being made keeps what was downloaded."""

DOWNLOAD_MB = 540
"""About what is downloaded for all packages, MB."""

TORCH_MB = 190
"""And for torch alone."""

SMALL_TORCH = "https://download.pytorch.org/whl/cpu"
"""An index with the torch for processors: on Linux the usual one brings CUDA along, 3 GB more."""

SYSTEMS = {"win": ("amd64", "Windows"), "linux": ("x86_64", "Linux"), "macosx": ("arm64", "macOS")}
"""Where every package has a wheel: sysconfig's name of a system -> the processors' and ours of it."""

OLDEST_MACOS = 14
"""For which the packages' wheels are built."""

_OF_ENVIRONMENTS = {
    "bin",
    "include",
    "lib",
    "lib64",
    "share",
    "Scripts",
    "Include",
    "Lib",
    "pyvenv.cfg",
    DOWNLOADS,
    ".gitignore",
    ".DS_Store",
}
_WORTH_TELLING = ("Collecting", "Downloading", "Using cached", "Processing", "Installing")  # pip's steps
_LOOK_S = 0.5


def python_of(folder: Path) -> Path:
    """The interpreter of the environment in ``folder``."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def not_packaged(system: str = sysconfig.get_platform(), macos: str = platform.mac_ver()[0]) -> str:
    """Why the package index holds no engine for this Python, '' where it does.

    ``system`` is sysconfig's name, as macosx-11.0-arm64; ``macos`` the version of macOS, '' elsewhere.
    """
    name, _, processor = system.replace("universal2", platform.machine()).partition("-")
    processor = processor.rpartition("-")[2]
    if processor != SYSTEMS.get(name, ("", ""))[0]:
        have = ", ".join(f"{told} ({processor})" for processor, told in SYSTEMS.values())
        return f"the engine's packages are made for {have}, and this is {system}"
    if macos and int(macos.partition(".")[0]) < OLDEST_MACOS:
        return f"the engine's packages are made for macOS {OLDEST_MACOS} and later, and this is {macos}"
    return ""


def make_environment(
    folder: Path, wheels: Path | None, progress: Progress, needed_mb: int = 0, lock: Path = LOCK
) -> Path:
    """Make or complete the environment in ``folder``; returns its interpreter.

    With ``wheels`` nothing is fetched from a network. Raises MachineError when the disk has less
    room than ``needed_mb``, when the folder holds something else, when the index has no packages for
    this system, when the lock is missing, and with pip's last line when something cannot be installed;
    what was downloaded stays for the next try.
    """
    python, downloads = python_of(folder), folder / DOWNLOADS
    _require_room(folder, needed_mb)
    if wheels is not None and not wheels.is_dir():
        raise MachineError("there is no such folder of wheels", where=wheels, cure="Choose another.")
    reason = not_packaged()
    if wheels is None and reason:
        raise MachineError(
            reason,
            cure="Make scenes on such a machine: this Blender opens and edits them. Or give a folder "
            "of wheels that you have built.",
        )
    with progress.task("Making an environment", 1) as task:
        if not _has_pip(python):
            _require_no_others(folder)
            folder.mkdir(parents=True, exist_ok=True)
            run_command(
                [sys.executable, "-m", "venv", "--clear", str(folder)],
                "an environment cannot be made here",
                "This Python lacks the module venv (Debian: python3-venv), or the folder cannot be written.",
            )
        task.advance()
    shutil.rmtree(downloads / "unfinished", ignore_errors=True)
    (downloads / "unfinished").mkdir(parents=True, exist_ok=True)
    for name, most_mb in (("torch", TORCH_MB), ("engine", DOWNLOAD_MB - TORCH_MB)):
        asked = downloads / f"{name}.txt"
        write_text(asked, _locked(lock / f"{name}.txt", by_hash=not reason))
        source = ["--no-index", "--find-links", str(wheels)] if wheels else _index(name)
        alone = ["--no-deps"] if name == "torch" else []
        arguments = [*source, *alone, *_uncompiled(name), "--requirement", str(asked)]
        _install(python, arguments, folder, progress, wheels is not None, most_mb)
    shutil.rmtree(downloads, ignore_errors=True)
    return python


def _uncompiled(name: str) -> list[str]:
    """Python compiles the modules that are imported, once; pip would compile all: most of the time that it takes.

    Of torch it does: a policy's process imports it where nothing may be written.
    """
    return [] if name == "torch" or os.environ.get("PYTHONDONTWRITEBYTECODE") else ["--no-compile"]


def _locked(file: Path, by_hash: bool) -> str:
    """The requirements of a lock. Of what a person has built for another system there are no hashes.

    Raises MachineError when the file is missing or damaged.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise MachineError(
            "the list of the engine's packages cannot be read", where=file, cure="Install the extension again."
        ) from error
    return f"--require-hashes\n{text}" if by_hash else re.sub(r"\s+\\?\s*--hash=\S+", "", text)


def _install(
    python: Path, asked: Sequence[str], folder: Path, progress: Progress, from_wheels: bool, most_mb: int
) -> None:
    """Have pip install what it is asked for."""
    downloads = folder / DOWNLOADS
    command = [
        *(str(python), "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar=off"),
        *("--cache-dir", str(downloads / "cache")),
        *asked,
    ]
    told = _PipProgress(progress, downloads, folder, "Reading wheels" if from_wheels else "Downloading, MB", most_mb)
    run_command(
        command,
        "the packages cannot be installed",
        "Check the network and the room on disk, or give a folder of wheels; then try again: "
        "what was downloaded is kept.",
        told.line,
        told.look,
        {"TMPDIR": str(downloads / "unfinished"), "PYTHONNOUSERSITE": "1"},
    )
    told.close()


class _PipProgress:
    """pip's lines and the files it makes, as two tasks: megabytes downloaded, packages installed."""

    def __init__(self, progress: Progress, downloads: Path, folder: Path, title: str, most_mb: int) -> None:
        self._progress = progress
        self._downloads = downloads
        self._packages = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder)}))
        self._open = contextlib.ExitStack()
        self._task = self._open.enter_context(progress.task(title, most_mb))
        self._installing = False
        self._before = 0
        self._kept_mb = self._cached_mb()

    def line(self, line: str) -> None:
        """Take one line of pip."""
        if line.startswith(_WORTH_TELLING):
            self._progress.message(line.partition(" (from -r ")[0])  # whose lines are nobody's concern
        if line.startswith("Installing collected packages:"):
            self._open.close()
            self._installing, self._before = True, self._installed()
            count = len(line.partition(":")[2].split(","))
            self._task = self._open.enter_context(self._progress.task("Installing packages", count))

    def look(self) -> None:
        """Advance by what has come since the last look."""
        done = self._installed() - self._before if self._installing else self._downloaded_mb()
        self._task.advance(max(0, min(done, self._task.total) - self._task.done))

    def close(self) -> None:
        """All is installed."""
        self._task.advance(self._task.total - self._task.done)
        self._open.close()

    def _downloaded_mb(self) -> int:
        return self._cached_mb() - self._kept_mb

    def _cached_mb(self) -> int:
        # pip writes a file to its cache when it is whole, and until then to the temporary folder.
        size = 0
        for file in self._downloads.rglob("*"):
            with contextlib.suppress(OSError):
                size += file.stat().st_size if file.is_file() else 0
        return size // 10**6

    def _installed(self) -> int:
        return sum(1 for _ in self._packages.glob("*.dist-info"))


def _index(name: str) -> list[str]:
    return ["--index-url", SMALL_TORCH] if name == "torch" and sys.platform.startswith("linux") else []


def _require_room(folder: Path, needed_mb: int) -> None:
    place = next(one for one in (folder, *folder.absolute().parents) if one.exists())
    free_mb = shutil.disk_usage(place).free // 10**6
    if free_mb < needed_mb:
        raise MachineError(
            f"the disk has {free_mb} MB left and {needed_mb} MB are needed",
            where=folder,
            cure="Make room, then try again.",
        )


def _require_no_others(folder: Path) -> None:
    """Raises MachineError where ``folder`` holds more than an environment, which begins with none of it."""
    others = sorted({path.name for path in folder.iterdir()} - _OF_ENVIRONMENTS) if folder.is_dir() else ()
    if others:
        raise MachineError(
            f"'{others[0]}' is in this folder, which would be emptied",
            where=folder,
            cure="Choose a new or an empty folder.",
        )


def _has_pip(python: Path) -> bool:
    """Whether there is an environment that was made to its end."""
    if not python.is_file():
        return False
    asked = subprocess.run([str(python), "-m", "pip", "--version"], capture_output=True)
    return asked.returncode == 0


def run_command(
    command: list[str],
    failure: str,
    cure: str,
    on_line: Callable[[str], None] = lambda line: None,
    look: Callable[[], None] = lambda: None,
    variables: dict[str, str] | None = None,
) -> None:
    """Run ``command``; ``on_line`` hears its lines, ``look`` is called now and then.

    Raises MachineError, ``failure`` with its last line, where it does not end well.
    """
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONUTF8": "1", "PYTHONSAFEPATH": "1", **(variables or {})},
        text=True,
        encoding="utf-8",
        errors="replace",
        **DYING_WITH_PARENT,
    )
    lines: list[str] = []
    reader = threading.Thread(target=_read, args=(process, lines), daemon=True)
    reader.start()
    heard, alive = 0, True
    while alive:
        reader.join(_LOOK_S)
        alive = reader.is_alive()  # asked first: what it read until then is heard below
        while heard < len(lines):
            on_line(lines[heard])
            heard += 1
        look()
    if process.wait() != 0:
        errors = [line for line in lines if line.startswith("ERROR:")]
        last = (errors or lines or ["no reason given"])[-1].removeprefix("ERROR:").strip()
        raise MachineError(f"{failure}: {last.rstrip('. ')}", where=command[0], cure=cure)


def _read(process: subprocess.Popen, lines: list[str]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        if line.strip():
            lines.append(line.strip())


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--wheels", type=Path, help="a folder of wheels instead of the network")
    parser.add_argument("--needed-mb", type=int, default=0, help="room that has to be on the disk")
    options = parser.parse_args(arguments)
    progress = JsonProgress()
    try:
        python = make_environment(options.folder, options.wheels, progress, options.needed_mb)
    except (R2SEgoError, OSError) as error:
        progress.emit_error(of_file(error) if isinstance(error, OSError) else error)
        return 1
    progress.emit(event="result", python=str(python))
    return 0


if __name__ == "__main__":
    sys.exit(main())
