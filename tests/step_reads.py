"""A bundle that notes what its steps read: files of the bundle, and settings."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.fields import Field
from r2sego_blender.config.settings import Settings
from r2sego_blender.refine.contents import Contents
from r2sego_blender.refine.steps import Steps

SECTIONS = {
    type(field.default): field.name
    for field in dataclasses.fields(Settings)
    if dataclasses.is_dataclass(field.default)
}


class WatchedScene(Scene):
    """Runs its steps, and notes by target: ``inputs``, the ``files`` read, the ``settings`` asked for."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene.path, scene.declaration)
        self.inputs: dict[str, list[str]] = {}
        self.files: dict[str, set[str]] = {}
        self.settings: dict[str, set[str]] = {}

    def step(self, target, compute, *, inputs=(), parameters=None, read=None):
        def watched(place: Path) -> None:
            with _noting(self.path, place) as (files, settings):
                compute(place)
            self.files[target], self.settings[target] = files, settings

        self.inputs[target] = [str(item) for item in inputs]
        return super().step(target, watched, inputs=inputs, parameters=parameters, read=read)


class KeysOnly(Scene):
    """Runs nothing: ``keys`` by target hold the inputs' names and the digest of the parameters."""

    def __init__(self, scene: Scene, **overrides) -> None:
        declaration = scene.declaration
        whole = dataclasses.replace(declaration, overrides={**declaration.overrides, **overrides})
        super().__init__(scene.path, whole)
        self.keys: dict[str, tuple[list[str], str]] = {}

    def step(self, target, compute, *, inputs=(), parameters=None, read=None):
        self.keys[target] = [str(item) for item in inputs], self._digest_of_inputs((), parameters)

    def redone(self, before: KeysOnly) -> set[str]:
        """The steps whose parameters differ, and those that read what such a step makes."""
        found: set[str] = set()
        for target, (inputs, digest) in self.keys.items():
            if before.keys[target][1] != digest or found & set(inputs):
                found.add(target)
        return found


def another(entry: Field) -> object:
    """A value that the setting may have, and does not."""
    return next(
        value for value in (*entry.choices, entry.low, entry.high) if value not in (None, entry.default)
    )


@contextlib.contextmanager
def unshared_contents() -> Iterator[None]:
    """Each step reads for itself, also what an earlier one has read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Steps, "_read", property(lambda self: Contents(self.scene, self.h)))
        yield


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
