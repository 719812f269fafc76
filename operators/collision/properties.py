"""What Blender remembers of the collision room: how the last check and the last texture came out."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ...r2sego_blender.bridge.collision.show_collision import shows_older_collision
from ...r2sego_blender.bridge.collision.show_collision_check import forget_off_surface
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.file_stamps import when_written
from .. import state


class R2SEGO_PG_collision_fact(bpy.types.PropertyGroup):
    """A line of the last check."""

    value: StringProperty()


class R2SEGO_PG_collision(bpy.types.PropertyGroup):
    """The room Collision."""

    older: BoolProperty()
    """Whether the shown collision surface was redone since."""
    checked: StringProperty()
    passed: BoolProperty()
    check: CollectionProperty(type=R2SEGO_PG_collision_fact)
    textured: StringProperty()
    texture: CollectionProperty(type=R2SEGO_PG_collision_fact)


def stamp(bundle: Bundle) -> str:
    """Another text for another collision surface."""
    return _stamp(bundle.collision_mesh)


def proxy_stamp(bundle: Bundle) -> str:
    """Another text for another proxy of the last round, which is the one that is textured."""
    return _stamp(bundle.proxy_file(max(0, bundle.rounds() - 1)))


def _stamp(file: Path) -> str:
    return f"{file} {when_written(file)}" if file.is_file() else ""


def read_bundle(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """The listener: forget a check of another surface and a texture of another proxy; note what is older."""
    group = scene.r2sego_collision
    group.older = shows_older_collision(scene, bundle)
    if group.checked != stamp(bundle):
        group.checked = ""
        group.check.clear()
        if state.may_show():
            forget_off_surface(scene, bundle)
    if group.textured != proxy_stamp(bundle):
        group.textured = ""
        group.texture.clear()


def tell(lines: bpy.types.bpy_prop_collection, facts: list[tuple[str, str]]) -> None:
    """Replace the lines by these, label and value."""
    lines.clear()
    for label, value in facts:
        line = lines.add()
        line.name, line.value = label, value


CLASSES = (R2SEGO_PG_collision_fact, R2SEGO_PG_collision)
