"""What panels show of the open bundles: read-only facts in plain Python, never in Blender's data.

Each Blender scene has one object of facts a kind, found by its class. They are read on purpose
(``operators/state.py``): when a bundle is opened, a job has ended, or the person asks. What a person chose
lies in properties; neither undo nor a saved .blend can bring facts of before back.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any, SupportsIndex

import bpy

from .moved_bundle import whole_path

ROWS = "r2sego_rows"
"""The window manager's blank rows, as many as the longest list of facts has: ``template_list`` wants a
collection of Blender's to count. They are of no bundle, and are never taken away."""


class Facts(tuple[Any, ...]):
    """Facts in their order, which a name finds too, as in a collection of Blender's."""

    __slots__ = ()

    def __getitem__(self, key: SupportsIndex | slice | str) -> Any:
        if not isinstance(key, str):
            return super().__getitem__(key)
        index = self.find(key)
        if index < 0:
            raise KeyError(key)
        return self[index]

    def __contains__(self, key: object) -> bool:
        return self.find(key) >= 0 if isinstance(key, str) else super().__contains__(key)

    def find(self, name: str) -> int:
        """The place of the one of this name, -1 when there is none."""
        return next((index for index, one in enumerate(self) if one.name == name), -1)


class Fact:
    """A read-only attribute of a property group: the scene's cached fact of the same name."""

    def __init__(self, kind: type) -> None:
        self._kind = kind

    def __set_name__(self, _owner: type, name: str) -> None:
        self._name = name

    def __get__(self, group: bpy.types.PropertyGroup | None, _owner: type | None = None) -> Any:
        return self if group is None else getattr(facts_of(group.id_data, self._kind), self._name)


@dataclass
class _Kept:
    """The facts of one Blender scene's bundle, by their class: what they were read for, what was wrong."""

    bundle: str
    facts: dict[type, Any] = field(default_factory=dict)
    chosen: dict[type, Hashable] = field(default_factory=dict)
    problems: dict[type, str] = field(default_factory=dict)


_kept: dict[int, _Kept] = {}
"""By the Blender scenes' session_uid."""


def begin(scene: bpy.types.Scene) -> None:
    """Know nothing of the scene's bundle."""
    _kept[scene.session_uid] = _Kept(whole_path(scene.r2sego.bundle))


def forget_all() -> None:
    """Know nothing of any scene's."""
    _kept.clear()


def keep(scene: bpy.types.Scene, facts: Any, chosen: Hashable = None, problem: str = "") -> None:
    """Keep ``facts`` in place of those of their class.

    ``chosen`` is what of a person's choices they were read for, None as before; ``problem`` says what was
    wrong with the bundle.
    """
    kept, kind = _of(scene), type(facts)
    kept.facts[kind], kept.problems[kind] = facts, problem
    if chosen is not None:
        kept.chosen[kind] = chosen
    make_rows(max((len(one) for one in vars(facts).values() if isinstance(one, Facts)), default=0))


def facts_of(scene: bpy.types.Scene, kind: type) -> Any:
    """The scene's facts of a class; empty ones while nothing was read."""
    return _of(scene).facts.get(kind) or kind()


def all_facts(scene: bpy.types.Scene) -> list[Any]:
    """The scene's facts of every class, in the order in which they were read first."""
    return list(_of(scene).facts.values())


def chosen_for(scene: bpy.types.Scene, kind: type) -> Hashable:
    """What facts of a class were read for, None when they were not read of this bundle."""
    return _of(scene).chosen.get(kind)


def problem_of(scene: bpy.types.Scene) -> str:
    """The first thing that is wrong, '' when nothing is."""
    return next(filter(None, _of(scene).problems.values()), "")


def make_rows(count: int) -> None:
    """Have ``count`` blank rows at least."""
    for manager in bpy.data.window_managers:
        rows = getattr(manager, ROWS)
        for _ in range(count - len(rows)):
            rows.add()


def _of(scene: bpy.types.Scene) -> _Kept:
    """What is kept of the scene's bundle; a copied scene has what is kept of the one it is copied of."""
    path, key = whole_path(scene.r2sego.bundle), scene.session_uid
    kept = _kept.get(key)
    if kept is None or kept.bundle != path:
        same = next((one for one in _kept.values() if one.bundle == path), _Kept(path))
        kept = _kept[key] = _Kept(path, dict(same.facts), dict(same.chosen), dict(same.problems))
    return kept
