"""What a person declares of an experiment, in TOML: scenes, counts, arms, seeds, presets (docs/experiments.md)."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ..bundle.figures import BASELINES
from ..bundle.layout import DECLARATION
from ..config.declared_files import Reader, did_you_mean, is_number
from ..config.fields import setting
from ..config.presets import PRESETS, by_dotted_keys, of_captures, preset, with_overrides
from ..config.settings import Settings
from ..core.errors import ExperimentError, SettingsError
from ..core.file_names import caseless, plain_name
from ..core.printable import printable
from ..evaluation.arms import ARMS, DEFAULT_ARMS
from ..results.panels.scene_choices import robot_choices, scope_choices
from .datasets.registry import DATASETS

MOST_CELLS = 10_000

Overrides = tuple[tuple[str, Any], ...]
"""Settings by their dotted keys, and their values."""

_LONGEST_NAME = 60


def _name(value: Any, _where: Path) -> str:
    if not isinstance(value, str) or plain_name(value) != value or len(value) > _LONGEST_NAME:
        raise ValueError(f"Write at most {_LONGEST_NAME} letters, digits, points, dashes and underscores.")
    return value


def _path(value: Any, where: Path) -> Path:
    """A path as the declaring file has it: relative to its own folder."""
    if not isinstance(value, str) or not value or "\0" in value:
        raise ValueError("Write a path in quotes.")
    return _place(value, where)


def _place(value: str, where: Path) -> Path:
    """The whole path of what may be there or not. Raises ValueError for what cannot be looked for."""
    try:
        place = (where.parent / Path(value).expanduser()).absolute()
        place.exists()
    except (OSError, RuntimeError) as error:  # a name too long for the disk, the home of somebody unknown
        raise ValueError(f"Write another path: {getattr(error, 'strerror', None) or error}.") from error
    return place


def _file_or(names: Sequence[str]) -> Callable[[Any, Path], str]:
    """One of the names, or the whole path of a file that the declaring one names relative to its own folder."""

    def read(value: Any, where: Path) -> str:
        if not isinstance(value, str) or "\0" in value:
            raise ValueError("Write a name, or a path in quotes.")
        file = _place(value, where)
        if file.is_file():
            return str(file)
        if value and value not in names:
            raise ValueError(did_you_mean(value, names, f"Give {', '.join(names)} or a file that is there."))
        return value

    return read


def _overrides(value: Any, _where: Path) -> Overrides:
    if not isinstance(value, Mapping):
        raise ValueError('Write settings by their keys, such as { "training.steps_per_round" = 900 }.')
    return tuple(by_dotted_keys(value).items())


def _camera_height(value: Any, _where: Path) -> str:
    """As the command takes it: a number of metres, written as one or as text, or robot."""
    if is_number(value):
        return repr(float(value))
    if not isinstance(value, str) or printable(value) != value:
        raise ValueError('Write metres, such as 1.5, or "robot".')
    return value


def _arms(value: Any, _where: Path) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise ValueError("Write a list.")
    names = tuple(dict.fromkeys(value))
    for name in names:
        if name not in ARMS:
            raise ValueError(did_you_mean(str(name), ARMS, f"Known: {', '.join(ARMS)}."))
    if not names:
        raise ValueError(f"Give some of: {', '.join(ARMS)}.")
    return names


@dataclass(frozen=True)
class PlannedScene:
    """A scene: photographs with the views that are held out of them, or a bundle that was made of some."""

    captures: Path = setting(doc="Folder of photographs, or a bundle.", read=_path)
    frozen: Path = setting(doc="cameras.json with a 'frozen' list, or a folder of held-out photographs.", read=_path)
    name: str = setting("", "Its name in tables; by default the folder's.", read=_name)
    poses: Path | None = setting(None, "Poses of the photographs; by default what lies there, else solved.", read=_path)
    robot: str = setting("", "As for `r2sego new`.", read=_file_or(robot_choices()))
    scope: str = setting("", "As for `r2sego new`.", read=_file_or(scope_choices()))
    camera_height: str = setting("", "As for `r2sego new`: metres, or robot.", read=_camera_height)
    overrides: Overrides = setting((), "Settings captures.* of the import.", read=_overrides)

    @property
    def is_bundle(self) -> bool:
        """Whether the captures were imported before."""
        return (self.captures / DECLARATION).is_file()


@dataclass(frozen=True)
class PlannedPreset:
    """Settings that scenes are refined with."""

    preset: str = setting("paper", "A named preset.", choices=tuple(PRESETS))
    name: str = setting("", "Its name in tables; by default the preset's.", read=_name)
    overrides: Overrides = setting((), "Single settings on top of it, but captures.* and seed.", read=_overrides)

    def settings(self, seed: int) -> Settings:
        """All settings of a cell of that seed."""
        return with_overrides({**dict(self.overrides), "seed": seed}, preset(self.preset))


@dataclass(frozen=True)
class Plan:
    """A declared experiment: every scene with every count, preset and seed is a cell; arms are compared in it."""

    scenes: tuple[PlannedScene, ...] = setting((), "Scenes.")
    counts: tuple[int, ...] = setting(
        (), "Capture counts: the first so many in the order of the poses. By default all there are.", 3, 10_000
    )
    refined_counts: tuple[int, ...] = setting(
        (),
        "Counts at which scenes are refined; at others methods of others alone are compared. By default all.",
        3,
        10_000,
    )
    arms: tuple[str, ...] = setting(DEFAULT_ARMS, "Arms that are compared.", read=_arms)
    seeds: tuple[int, ...] = setting((0,), "Seeds; arms of one seed are a pair.", 0, 2**31 - 1)
    presets: tuple[PlannedPreset, ...] = setting((PlannedPreset(name="paper"),), "Presets.")
    published: str = setting("", "A data set whose published figures stand below the tables.", choices=("", *DATASETS))
    threads: int = setting(1, "Threads of a cell.", 1, 1024)
    memory_mb: int = setting(4000, "Memory that a cell is taken to need until one was measured, MB.", 1, 10**7)

    def arms_at(self, count: int) -> tuple[str, ...]:
        """The arms that are compared at a count of captures."""
        if not self.refined_counts or count in self.refined_counts:
            return self.arms
        return tuple(arm for arm in self.arms if arm in BASELINES)

    @staticmethod
    def load(file: Path, scenes: Sequence[PlannedScene] = ()) -> Plan:
        """Read a plan; ``scenes``, if any, stand in place of its own.

        Raises ExperimentError naming the key and the cure.
        """
        reader = Reader(Path(file).absolute(), "plan of experiments", ExperimentError)
        try:
            plan = reader.table(Plan, reader.tables("See docs/experiments.md."))
            plan = dataclasses.replace(
                plan,
                scenes=tuple(_named(one, one.captures.name.removesuffix(".r2s")) for one in (scenes or plan.scenes)),
                presets=tuple(_named(one, one.preset) for one in plan.presets),
            )
            _checked(plan, reader)
        except OSError as error:
            cure = "Give a TOML file, as in docs/experiments.md, with captures that may be read."
            raise ExperimentError(f"this plan cannot be read: {error}", where=file, cure=cure) from error
        return plan


def _named(one: Any, name: str) -> Any:
    return one if one.name else dataclasses.replace(one, name=plain_name(name)[:_LONGEST_NAME])


def _checked(plan: Plan, reader: Reader) -> None:
    """Raises ExperimentError for what one field alone does not tell."""

    def wrong(place: str, what: str, cure: str) -> NoReturn:
        raise reader.wrong(place, what, cure)

    named = (("scenes", [one.name for one in plan.scenes]), ("presets", [one.name for one in plan.presets]))
    for place, values in (*named, ("counts", plan.counts), ("seeds", plan.seeds)):
        spelt = Counter(caseless(str(value)) for value in values)
        if twice := [value for value in values if spelt[caseless(str(value))] > 1]:
            wrong(place, f"has {twice[0]} twice", "Give each once, scenes and presets a name of their own.")
        if not values and place != "counts":
            wrong(place, "is empty", f"Give at least one of {place}.")
    if unplanned := [count for count in plan.refined_counts if count not in plan.counts]:
        wrong("refined_counts", f"has {unplanned[0]}, which is none of the counts", "Give some of the counts.")
    if plan.refined_counts and not any(arm in BASELINES for arm in plan.arms):
        wrong("refined_counts", "leaves other counts without an arm", "Take it away, or add methods of others to arms.")
    for index, scene in enumerate(plan.scenes):
        own = ("poses", "robot", "scope", "camera_height", "overrides")
        given = [*["counts"] * bool(plan.counts), *(name for name in own if getattr(scene, name))]
        if scene.is_bundle and given:
            cure = f"A bundle has its own: give the folder of photographs, or take {', '.join(given)} away."
            wrong(f"scenes[{index}].captures", "is a bundle", cure)
        _refuse_settings(dict(scene.overrides), f"scenes[{index}].overrides", True, reader)
    for index, one in enumerate(plan.presets):
        _refuse_settings(dict(one.overrides), f"presets[{index}].overrides", False, reader)
    if len(plan.scenes) * len(plan.seeds) * len(plan.presets) * max(1, len(plan.counts)) > MOST_CELLS:
        wrong("scenes", "make too many cells", f"Plan at most {MOST_CELLS}.")


def _refuse_settings(overrides: Mapping[str, Any], place: str, import_alone: bool, reader: Reader) -> None:
    of_import = of_captures(overrides)
    for key in overrides:
        if key == "seed" or (key in of_import) != import_alone:
            cure = "Settings captures.* belong to a scene's overrides, all others but seed to a preset's."
            raise reader.wrong(f"{place}.{key}", "does not belong there", cure)
    try:
        with_overrides(overrides)
    except SettingsError as error:
        raise reader.wrong(place, f"has a mistake: {error.what}", error.cure) from error
