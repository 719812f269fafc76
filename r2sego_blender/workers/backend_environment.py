"""An environment of its own for a learned backend: what would be done, step by step, and done only when asked to."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import MachineError
from ..core.progress import Progress
from ..core.text_files import write_text
from .environment import python_of, run_command
from .learned_backends import LearnedBackend
from .programs import find_program
from .protocol.program_worker import library_command

INSTALLED = "installed.txt"
"""What pip found in the environment at last, each package with its version."""

_PATHS = """\
import pathlib, sys, sysconfig
place = pathlib.Path(sysconfig.get_path('purelib'), sys.argv[1])
place.write_text('\\n'.join(sys.argv[2:]))
"""
_CURE = "Check the network and the room on disk, then try again: what was done is kept."


@dataclass(frozen=True)
class Step:
    """One command, and in words what it does."""

    what: str
    command: tuple[str, ...]


def steps_of(backend: LearnedBackend, folder: Path) -> list[Step]:
    """What makes the environment of ``backend`` in ``folder``, in this order.

    Raises MachineError for one that nobody can install so.
    """
    recipe = backend.recipe
    if recipe is None:
        raise MachineError(
            f"{backend.label} cannot be installed by a command", where=backend.name, cure="See docs/backends.md."
        )
    python = str(python_of(folder))
    pip = (python, "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar=off", "--retries=1")
    steps = [Step("make an environment", (sys.executable, "-m", "venv", str(folder)))]
    if recipe.torch:
        steps.append(Step("install torch", (*pip, *recipe.torch)))
    if recipe.clone is not None:
        repository, commit = recipe.clone
        place = folder / repository.rpartition("/")[2]
        git = find_program("git") or "git"
        if not place.is_dir():
            steps.append(Step("clone the code", (git, "clone", "--no-checkout", repository, str(place))))
        at = (git, "-C", str(place))
        steps.append(Step("take the commit that was read", (*at, "checkout", "--detach", commit)))
        steps.append(Step("and what it brings", (*at, "submodule", "update", "--init", "--recursive")))
        paths = [str(place / one) for one in recipe.paths]
        steps.append(Step("put it on the path", (python, "-c", _PATHS, f"{place.name}.pth", *paths)))
    steps.append(Step("install its packages", (*pip, *recipe.torch, *recipe.packages)))
    if backend.worker:
        fetch = library_command(python, f"workers.models.{backend.worker}", "--fetch", backend.name)
        steps.append(Step("fetch the weights", tuple(fetch)))
    return steps


def install(backend: LearnedBackend, folder: Path, progress: Progress) -> Path:
    """Do all of ``steps_of``; returns the interpreter, and ``installed.txt`` beside it says what was installed.

    Raises MachineError, with the last line of what failed, where there is no network for one.
    """
    steps = steps_of(backend, folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with progress.task(f"Setting up {backend.label}", len(steps)) as task:
        for step in steps:
            progress.message(step.what)
            run_command(list(step.command), f"could not {step.what}", _CURE, variables={"PYTHONNOUSERSITE": "1"})
            task.advance()
    python = python_of(folder)
    found: list[str] = []
    run_command([str(python), "-m", "pip", "freeze"], "pip cannot say what it installed", _CURE, found.append)
    write_text(folder / INSTALLED, "\n".join([*found, ""]))
    return python


def in_words(steps: Sequence[Step]) -> list[str]:
    """Each step, and the command as a shell would take it."""
    return [line for step in steps for line in (f"# {step.what}", shlex.join(step.command))]
