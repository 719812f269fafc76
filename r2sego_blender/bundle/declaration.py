"""What a person declared of a scene, and how ``scene.toml`` says it. Blender's Python reads it too."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..config.declared_files import Reader
from ..config.fields import setting
from ..config.presets import by_dotted_keys, of_captures, present_keys, preset, with_overrides
from ..config.settings import Settings
from ..core.atomic_files import write_whole
from ..core.cameras import is_similarity
from ..core.errors import SceneError, SettingsError
from .backends import BACKENDS, chosen_backends
from .layout import DECLARATION, SCOPE_FILE

FORMAT = 1
"""The version of the bundle's layout."""

SOLVED = "structure from motion"
"""How the source of captures begins whose poses were solved from the photographs themselves."""

_FORM_OF_MATRIX = "Write the similarity's four rows of four numbers, or make the scene anew with `r2sego new`."


@dataclass(frozen=True)
class Declaration:
    """What the person declared, the content of ``scene.toml``.

    ``world_from_capture`` is the (4, 4) similarity, row by row, that took the frame of the
    given poses to the world; ``scale_source`` and ``ground`` say how it was found. Where a
    setting chooses the backend of a slot, ``backends`` follows it; ``overrides`` are by the
    settings' present names. ``captures_chosen`` lists the frames that were taken of a video, with their
    times. ``scope`` is a shipped scope's
    name or the whole path of a file; one inside the bundle is written relative to it.
    """

    captures_source: str
    world_from_capture: tuple[tuple[float, ...], ...]
    ground: str
    scale_source: str
    robot: str = "embedded:humanoid"
    scope: str = "walk_and_look"
    mesh_library: str = ""
    preset: str = "paper"
    overrides: Mapping[str, Any] = field(default_factory=dict)
    backends: Mapping[str, str] = field(default_factory=lambda: dict(BACKENDS))
    captures_chosen: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "overrides", present_keys(self.overrides))
        object.__setattr__(self, "backends", {**self.backends, **chosen_backends(self.settings)})

    @property
    def settings(self) -> Settings:
        """The preset with the person's overrides."""
        return with_overrides(self.overrides, preset(self.preset))

    @property
    def poses_solved(self) -> bool:
        """Whether the captures' poses were solved from the photographs: no other file's poses are in that frame."""
        return self.captures_source.startswith(SOLVED)

    def with_settings(self, preset: str | None, changes: Mapping[str, Any]) -> Declaration:
        """With ``changes`` among its overrides; another ``preset`` than before begins without any but those that the
        captures were made with."""
        if preset in (None, self.preset):
            return dataclasses.replace(self, overrides={**self.overrides, **changes})
        return dataclasses.replace(self, preset=preset, overrides={**of_captures(self.overrides), **changes})


@dataclass(frozen=True)
class _Captures:
    source: str
    chosen: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Registration:
    ground: str
    scale_source: str
    world_from_capture: tuple[tuple[float, ...], ...] = setting(read=lambda rows, _: _matrix(rows))


@dataclass(frozen=True)
class _Robot:
    model: str
    scope: str


@dataclass(frozen=True)
class _Priors:
    mesh_library: str = ""


@dataclass(frozen=True)
class _Settings:
    preset: str
    overrides: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _File:
    """The tables of ``scene.toml``."""

    captures: _Captures
    registration: _Registration
    robot: _Robot
    settings: _Settings
    backends: Mapping[str, str]
    priors: _Priors = _Priors()


def read_declaration(path: Path) -> Declaration:
    """The declaration of the bundle ``path``, its scope by a whole path where that is a file.

    Raises SceneError when it is missing, damaged or of another version.
    """
    file = path / DECLARATION
    reader = Reader(file, "scene", SceneError, strict=False)
    try:
        data = reader.tables("Mend the line.")
    except (FileNotFoundError, NotADirectoryError) as error:
        if path.is_dir():
            raise SceneError("this is not a scene bundle", where=file, cure="Make one with `r2sego new`.") from error
        what = "this is a file, and a scene is a folder" if path.exists() else "there is no such folder"
        raise SceneError(what, where=path, cure="Check the path; `r2sego new` makes a scene.") from error
    if data.get("format") != FORMAT:
        raise SceneError(
            f"the bundle has format {data.get('format')!r}, this version reads {FORMAT}",
            where=f"{file}: format",
            cure="Open it with the version that made it, or make it anew with `r2sego new`.",
        )
    declared = reader.table(_File, data)
    try:
        return Declaration(
            captures_source=declared.captures.source,
            captures_chosen=declared.captures.chosen,
            world_from_capture=declared.registration.world_from_capture,
            ground=declared.registration.ground,
            scale_source=declared.registration.scale_source,
            robot=declared.robot.model,
            scope=_scope_here(declared.robot.scope, path),
            mesh_library=declared.priors.mesh_library,
            preset=declared.settings.preset,
            overrides=by_dotted_keys(declared.settings.overrides),
            backends={slot: str(label) for slot, label in declared.backends.items()},
        )
    except SettingsError as error:
        raise SettingsError(error.what, where=f"{file}: {error.where}", cure=error.cure) from error


def _matrix(rows: Any) -> tuple[tuple[float, ...], ...]:
    """The (4, 4) similarity, row by row. Raises ValueError for anything else."""
    try:
        matrix = tuple(tuple(map(float, row)) for row in rows)
    except (TypeError, ValueError):
        matrix = ()
    if [len(row) for row in matrix] != [4] * 4 or not is_similarity(np.array(matrix)):
        raise ValueError(_FORM_OF_MATRIX)
    return matrix


def _scope_here(scope: str, bundle: Path) -> str:
    """The declared ``scope`` of a bundle that may have been moved or copied: its own lies in it.

    Bundles once declared their own scope by its whole path, which is that of where they were.
    """
    if not Path(scope).is_absolute():
        return str((bundle / scope).absolute()) if Path(scope).suffix else scope
    own = bundle / SCOPE_FILE
    if Path(scope).parts[-2:] != own.parts[-2:] or not own.is_file():
        return scope
    was_a_bundles = not Path(scope).is_file() or (Path(scope).parents[1] / DECLARATION).is_file()
    return str(own.absolute()) if was_a_bundles else scope


def name_in(bundle: Path, file: str) -> str:
    """How ``bundle`` names ``file``: relative to itself where it lies inside, else as it is."""
    if not Path(file).is_absolute():  # the name of what comes with the library
        return file
    for place, folder in ((Path(file), bundle.absolute()), (Path(file).resolve(), bundle.resolve())):
        if place.is_relative_to(folder):
            return place.relative_to(folder).as_posix()
    return file


def write_declaration(file: Path, declaration: Declaration) -> None:
    """Write the declaration as ``file`` of its bundle, whole or not at all."""
    import tomli_w  # the engine writes bundles; Blender's Python only reads them

    data = {
        "format": FORMAT,
        "captures": {"source": declaration.captures_source}
        | ({"chosen": list(declaration.captures_chosen)} if declaration.captures_chosen else {}),
        "registration": {
            "ground": declaration.ground,
            "scale_source": declaration.scale_source,
            "world_from_capture": [list(row) for row in declaration.world_from_capture],
        },
        "robot": {"model": declaration.robot, "scope": name_in(file.parent, declaration.scope)},
        "priors": {"mesh_library": declaration.mesh_library},
        "backends": dict(declaration.backends),
        "settings": {"preset": declaration.preset, "overrides": dict(declaration.overrides)},
    }
    write_whole(file, tomli_w.dumps(data))
