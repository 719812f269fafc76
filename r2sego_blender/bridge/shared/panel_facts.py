"""What panels show of the open bundles: read-only facts in plain Python, never in Blender's data.

Each Blender scene has one object of facts a kind, found by its class. They are read on purpose
(``operators/state.py``): when a bundle is opened, a job has ended, or the person asks. What a person chose
lies in properties; neither undo nor a saved .blend can bring facts of before back.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Kept:
    """Facts of one class, what of a person's choices they were read for, and what was wrong."""

    facts: Any
    chosen: Hashable = None
    problem: str = ""


_scenes: dict[int, tuple[str, dict[type, Kept]]] = {}
"""The path of the bundle and the facts by their classes, by the Blender scenes' session_uid."""


def begin(scene: bpy.types.Scene) -> None:
    """Know nothing of the scene's bundle."""
    _scenes[scene.session_uid] = whole_path(scene.r2sego.bundle), {}


def forget_all() -> None:
    """Know nothing of any scene's."""
    _scenes.clear()


def keep(scene: bpy.types.Scene, facts: Any, chosen: Hashable = None, problem: str = "") -> None:
    """Keep ``facts`` in place of those of their class; with ``chosen`` None, for the same choices."""
    kept, kind = kept_of(scene), type(facts)
    if chosen is None and kind in kept:
        chosen = kept[kind].chosen
    kept[kind] = Kept(facts, chosen, problem)
    make_rows(max((len(one) for one in vars(facts).values() if isinstance(one, Facts)), default=0))


def facts_of(scene: bpy.types.Scene, kind: type) -> Any:
    """The scene's facts of a class; empty ones while nothing was read."""
    kept = kept_of(scene).get(kind)
    return kind() if kept is None else kept.facts


def kept_of(scene: bpy.types.Scene) -> dict[type, Kept]:
    """All that is known of the scene's bundle, in the order in which it was read first; a copied scene
    begins with what is known of the one it is copied of."""
    path, key = whole_path(scene.r2sego.bundle), scene.session_uid
    if key not in _scenes or _scenes[key][0] != path:
        same = next((kept for bundle, kept in _scenes.values() if bundle == path), {})
        _scenes[key] = path, dict(same)
    return _scenes[key][1]


def make_rows(count: int) -> None:
    """Have ``count`` blank rows at least."""
    for manager in bpy.data.window_managers:
        rows = getattr(manager, ROWS)
        for _ in range(count - len(rows)):
            rows.add()
