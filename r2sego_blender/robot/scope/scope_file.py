"""Writing behaviour scopes: as TOML that is read back, with fields changed, in another frame."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ...config.declared_files import parse_toml
from ...core.errors import RobotError
from ...core.text_files import write_text
from .scope import BehaviourScope

# tomli_w gives each element a line; people read ranges and corners in one.
_NUMBERS = re.compile(r"\[\s*((?:[-+.\de]+,\s*)+)\]")


def tables_of(scope: BehaviourScope) -> dict[str, Any]:
    """The scope as the tables of its file: every field, but for those that are absent or empty."""
    tables: dict[str, Any] = {"name": scope.name}
    for field in dataclasses.fields(scope):
        if field.name != "name":
            fields = dataclasses.asdict(getattr(scope, field.name))
            told = {key: _plain(value) for key, value in fields.items() if value not in (None, "", ())}
            tables |= {field.name: told} if told else {}
    return tables


def save_scope(scope: BehaviourScope, file: Path) -> None:
    """Write the scope; the files it names are written with their whole paths."""
    text = _NUMBERS.sub(_in_one_line, tomli_w.dumps(tables_of(scope)))
    write_text(file, text)


def changed_scope(scope: BehaviourScope, changes: Mapping[str, Any], where: Path) -> BehaviourScope:
    """The scope with fields set by their names, such as ``sit_on.target``; None: its default again.

    Values are as TOML has them; the files they name are looked for beside ``where``, which
    errors name too. Raises RobotError as ``BehaviourScope.load`` does.
    """
    tables = copy.deepcopy(tables_of(scope))
    for key, value in changes.items():
        section, _, field = key.partition(".")
        table = tables.setdefault(section, {})
        if not field or not isinstance(table, dict):
            raise RobotError(
                f"'{key}' is no field of a behaviour scope",
                where=where,
                cure="Name a section and a field, such as walk_to.speed_m_s.",
            )
        if value is None and hasattr(getattr(scope, section, None), field):
            table.pop(field, None)
        else:
            table[field] = value  # an unknown one is refused when it is read
    return BehaviourScope.from_tables(tables, where)


def moved_scope(scope: BehaviourScope, similarity: np.ndarray, where: Path) -> BehaviourScope:
    """The scope after a (4, 4) similarity of the world; the same where it names no place.

    Places are on the floor: what the similarity lifts off it is dropped. Raises RobotError,
    naming ``where``, when the moved region is none.
    """
    changes: dict[str, Any] = {}
    if not isinstance(scope.region.within, str):
        changes["region.within"] = _moved(scope.region.within, similarity)
    if not isinstance(scope.sit_on.target, str):
        (changes["sit_on.target"],) = _moved([scope.sit_on.target], similarity)
    return changed_scope(scope, changes, where) if changes else scope


def value_of(text: str) -> Any:
    """A value as written in TOML; what is no TOML is a text, and nothing is None.

    Raises RobotError for what begins as a list or a table and is none.
    """
    if not text:
        return None
    try:
        return parse_toml(f"value = {text}")["value"]
    except (ValueError, RecursionError) as error:
        if text.lstrip()[:1] in ("[", "{"):
            raise RobotError(
                f"'{text}' is no TOML value: {error}",
                where="--set",
                cure='Write a list as ["a", 1.5] and a table as {name = 1.5}.',
            ) from error
        return text


def _in_one_line(numbers: re.Match[str]) -> str:
    return f"[{', '.join(numbers[1].replace(',', ' ').split())}]"


def _plain(value: Any) -> Any:
    """Tuples as lists, at any depth, as TOML has them."""
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return value


def _moved(places: Any, similarity: np.ndarray) -> list[list[float]]:
    points = np.asarray(places, np.float64)
    return (points @ similarity[:2, :2].T + similarity[:2, 3]).tolist()
