"""What Blender remembers of the collision room: how the last check and the last texture came out.

No file has that, so it stays in the .blend; it is told while the surface, or the proxy, is still the same.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty

from ...r2sego_blender.bridge.collision.show_collision import shows_older_collision
from ...r2sego_blender.bridge.collision.show_collision_check import forget_off_surface
from ...r2sego_blender.bridge.shared.panel_facts import facts_of
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.file_stamps import when_written
from .. import state


@dataclass(frozen=True)
class CollisionFacts:
    """When the collision surface was written, and the last round's proxy, which is the one textured, each
    with the file's path; '' where there is none."""

    surface: str = ""
    proxy: str = ""
    surface_written: str = ""


class R2SEGO_PG_collision_line(bpy.types.PropertyGroup):
    """A line of the last check, or of the last texture."""

    value: StringProperty()


class R2SEGO_PG_collision(bpy.types.PropertyGroup):
    """The room Collision."""

    check_of: StringProperty()
    check_passed: BoolProperty()
    check_lines: CollectionProperty(type=R2SEGO_PG_collision_line)
    texture_of: StringProperty()
    texture_lines: CollectionProperty(type=R2SEGO_PG_collision_line)

    @property
    def older(self) -> bool:
        """Whether the shown collision surface was redone since."""
        scene = self.id_data
        written = facts_of(scene, CollisionFacts).surface_written
        return bool(written) and shows_older_collision(scene, state.bundle_path(scene), written)

    @property
    def checked(self) -> bool:
        """Whether the surface, as it is now, was checked."""
        return self.check_of != "" and self.check_of == facts_of(self.id_data, CollisionFacts).surface

    @property
    def passed(self) -> bool:
        """Whether it passed."""
        return self.checked and self.check_passed

    @property
    def check(self) -> Sequence[R2SEGO_PG_collision_line]:
        """The lines of its check."""
        return self.check_lines if self.checked else ()

    @property
    def texture(self) -> Sequence[R2SEGO_PG_collision_line]:
        """The lines of the last texture of the proxy as it is now."""
        same = self.texture_of == facts_of(self.id_data, CollisionFacts).proxy
        return self.texture_lines if same else ()


def read(_scene: bpy.types.Scene, bundle: Bundle) -> CollisionFacts:
    """The files' state."""
    surface, proxy = bundle.collision_mesh, bundle.proxy_file(max(0, bundle.rounds() - 1))
    written = [when_written(file) for file in (surface, proxy)]
    stamps = [f"{file} {when}" if when else "" for file, when in zip((surface, proxy), written, strict=True)]
    return CollisionFacts(*stamps, written[0])


def follow(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Mark no longer what a check of another surface found."""
    if not scene.r2sego_collision.checked:
        forget_off_surface(scene, bundle)


def tell(lines: bpy.types.bpy_prop_collection, facts: Iterable[tuple[str, str]]) -> None:
    """Replace the lines by these, label and value."""
    lines.clear()
    for label, value in facts:
        line = lines.add()
        line.name, line.value = label, value
