"""A runner that notes what its steps read: files of the bundle, settings, and the environment."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from r2sego_blender.bundle.runner import Runner, Step
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.fields import Field
from r2sego_blender.config.settings import Settings

SECTIONS = {
    type(field.default): field.name for field in dataclasses.fields(Settings) if dataclasses.is_dataclass(field.default)
}


class WatchedRunner(Runner):
    """Runs its steps, and notes by target: ``inputs``, the ``files`` read, the ``settings`` asked for,
    and the ``variables`` of the environment that this library looked at."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.inputs: dict[str, list[str]] = {}
        self.files: dict[str, set[str]] = {}
        self.settings: dict[str, set[str]] = {}
        self.variables: dict[str, set[str]] = {}

    def do(self, step: Step) -> None:
        def watched(place: Path) -> None:
            with _noting(self.scene.path, place) as (files, settings), _environment() as variables:
                step.compute(place)
            self.files[step.target], self.settings[step.target] = files, settings
            self.variables[step.target] = variables

        self.inputs[step.target] = list(step.inputs)
        super().do(dataclasses.replace(step, compute=watched))


class KeysOnly(Runner):
    """Runs nothing: ``keys`` by target hold the inputs' names and the digest of the parameters."""

    def __init__(self, scene: Scene, **overrides) -> None:
        declaration = scene.declaration
        whole = dataclasses.replace(declaration, overrides={**declaration.overrides, **overrides})
        super().__init__(Scene(scene.path, whole))
        self.keys: dict[str, tuple[list[str], str]] = {}

    def do(self, step: Step) -> None:
        self.keys[step.target] = list(step.inputs), self.key((), step.parameters)

    def redone(self, before: KeysOnly) -> set[str]:
        """The steps whose parameters differ, and those that read what such a step makes."""
        found: set[str] = set()
        for target, (inputs, digest) in self.keys.items():
            if before.keys[target][1] != digest or found & set(inputs):
                found.add(target)
        return found


def another(entry: Field) -> object:
    """A value that the setting may have, and does not."""
    return next(value for value in (*entry.choices, entry.low, entry.high) if value not in (None, entry.default))


@contextlib.contextmanager
def _environment() -> Iterator[set[str]]:
    """The names of environment variables that code of this library asks for."""
    library, asked = f"{os.sep}r2sego_blender{os.sep}", set()

    class Noting(type(os.environ)):
        def __getitem__(self, name):
            if library in sys._getframe(1).f_code.co_filename or _asked_by(library):
                asked.add(name)
            return super().__getitem__(name)

    def _asked_by(place: str) -> bool:
        frame = sys._getframe(2)
        while frame is not None and frame.f_code.co_filename.endswith(("os.py", "_collections_abc.py")):
            frame = frame.f_back
        return frame is not None and place in frame.f_code.co_filename

    plain = type(os.environ)
    os.environ.__class__ = Noting
    try:
        yield asked
    finally:
        os.environ.__class__ = plain


@contextlib.contextmanager
def _noting(bundle: Path, staging: Path) -> Iterator[tuple[set[str], set[str]]]:
    files: set[str] = set()
    settings: set[str] = set()

    def opened(event: str, arguments: tuple) -> None:
        if event == "open" and isinstance(arguments[0], str | os.PathLike):
            path = Path(arguments[0])
            if path.is_relative_to(bundle) and not path.is_relative_to(staging) and path.is_file():
                files.add(path.relative_to(bundle).as_posix())

    def asked(section: object, name: str) -> object:
        if name in type(section).__dataclass_fields__:
            settings.add(f"{SECTIONS[type(section)]}.{name}")
        return object.__getattribute__(section, name)

    with pytest.MonkeyPatch.context() as patch:
        for section in SECTIONS:
            patch.setattr(section, "__getattribute__", asked, raising=False)
        _listeners.append(opened)
        try:
            yield files, settings
        finally:
            _listeners.remove(opened)


_listeners: list = []


def _audit(event: str, arguments: tuple) -> None:
    for listener in _listeners:
        listener(event, arguments)


sys.addaudithook(_audit)  # a hook cannot be taken away: it is there once, and quiet without listeners
