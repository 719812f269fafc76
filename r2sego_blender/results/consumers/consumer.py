"""What a consumer of exported rooms is: whose code reads the folder, and what writes it."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...bundle.scene import Scene
from ...core.progress import SILENT, Progress
from ...geometry.collision.collision_files import HULLS, SCENE_XML
from ...refine.behaviour import DeclaredBehaviour
from ...robot.planning.free_floor import FreeFloor, free_floor
from ...splats.asset import SplatAsset
from ...splats.formats.registry import load_asset

ROOM_PY = "room.py"
"""What shows, and does, how the consumer's own loader takes the folder."""


@dataclass(frozen=True)
class ExportedRoom:
    """What a consumer's folder is made of.

    The ``asset`` of a finished scene, its ``collision`` folder as exported, and what finds the free floor of its
    robot and scope there, which may raise RobotError.
    """

    asset: SplatAsset
    collision: Path
    free_floor: Callable[[], FreeFloor]
    progress: Progress = SILENT

    @staticmethod
    def of(scene: Scene, collision: Path, progress: Progress) -> ExportedRoom:
        """A finished scene's, whose surface was exported to ``collision``."""

        @functools.cache  # several consumers may ask
        def free() -> FreeFloor:
            behaviour = DeclaredBehaviour.of(scene)
            scope = behaviour.placed_in(scene, scene.rounds_of_result() - 1)
            return free_floor(behaviour.model, scope, collision / SCENE_XML)

        return ExportedRoom(load_asset(scene.asset_file), collision, free, progress)


@dataclass(frozen=True)
class Consumer:
    """A consumer; the file of this folder that writes for it calls it ``CONSUMER``.

    ``name`` is the word after ``--for`` and the name of its folder in an export; ``about`` says what is in it.
    ``write`` fills the folder, which is there and empty; it raises R2SEgoError where the room has not what the
    consumer wants.
    """

    name: str
    about: str
    write: Callable[[ExportedRoom, Path], None]


def copy_scene(room: ExportedRoom, folder: Path) -> None:
    """MuJoCo's scene and its pieces, as they are."""
    shutil.copyfile(room.collision / SCENE_XML, folder / SCENE_XML)
    shutil.copytree(room.collision / HULLS, folder / HULLS)
