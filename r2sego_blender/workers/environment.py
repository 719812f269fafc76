"""Make the engine's environment: ``python -m r2sego_blender.workers.environment FOLDER``.

Needs nothing but the standard library, so Blender's own Python runs it. Packages come from
the package index, or from a folder of wheels on a machine without a network. Progress is
told as the engine tells it, in JSON lines.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

from ..errors import MachineError, R2SEgoError
from ..progress import JsonProgress, Progress

PROJECT_FILE = Path(__file__).resolve().parents[2] / "pyproject.toml"
_WORTH_TELLING = ("Collecting", "Downloading", "Processing", "Installing")  # pip's steps


def required_packages(project_file: Path = PROJECT_FILE) -> list[str]:
    """The engine's requirements, as the project declares them.

    Raises MachineError when the file is missing or damaged.
    """
    try:
        return list(tomllib.loads(project_file.read_text(encoding="utf-8"))["project"]["dependencies"])
    except (OSError, tomllib.TOMLDecodeError, KeyError) as error:
        raise MachineError(
            "the list of the engine's packages cannot be read", where=project_file,
            cure="Install the extension again.",
        ) from error  # fmt: skip


def python_of(folder: Path) -> Path:
    """The interpreter of the environment in ``folder``."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def make_environment(
    folder: Path, requirements: Sequence[str], wheels: Path | None, progress: Progress
) -> Path:
    """Make or complete the environment in ``folder``; returns its interpreter.

    With ``wheels`` nothing is fetched from a network. Raises MachineError with pip's last
    line when something cannot be installed; what was installed stays for the next try.
    """
    python = python_of(folder)
    source = ["--no-index", "--find-links", str(wheels)] if wheels else []
    with progress.task("Setting up the engine", 2) as task:
        if not python.is_file():
            _run([sys.executable, "-m", "venv", str(folder)], "an environment cannot be made here", progress)
        task.advance()
        # One call, so that pip finds versions that agree with each other.
        command = [str(python), "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar=off"]
        _run([*command, *source, *requirements], "the packages cannot be installed", progress)
        task.advance()
    return python


def _run(command: list[str], failure: str, progress: Progress) -> None:
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONNOUSERSITE": "1"}, text=True, errors="replace",
    )  # fmt: skip
    last = "no reason given"
    for line in process.stdout:
        if line.strip():
            last = line.strip()
        if last.startswith(_WORTH_TELLING):
            progress.message(last)
    if process.wait() != 0:
        raise MachineError(
            f"{failure}: {last}", where=command[0],
            cure="Check the network and the room on disk, or give a folder of wheels; then try again.",
        )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--wheels", type=Path, help="a folder of wheels instead of the network")
    options = parser.parse_args(arguments)
    progress = JsonProgress()
    try:
        python = make_environment(options.folder, required_packages(), options.wheels, progress)
    except R2SEgoError as error:
        progress.emit(event="error", kind=type(error).__name__, text=str(error))
        return 1
    progress.emit(event="result", python=str(python))
    return 0


if __name__ == "__main__":
    sys.exit(main())
