"""Newton 1.8: splats and convex pieces as one USD stage, and the splats as PLY."""

from __future__ import annotations

import shutil
from pathlib import Path

from ...core.text_files import write_text
from ...geometry.collision.collision_files import SCENE_USD
from ...splats.formats.registry import save_asset
from ..usd_stage import write_room_stage
from .consumer import ROOM_PY, Consumer, ExportedRoom

SPLATS_PLY, SPLATS_USD = "splats.ply", "splats.usdc"
_ROOM_PY = '''"""The room for Newton: ``add_room(builder)`` adds what bodies touch and what cameras see.

Newton's own ``Gaussian.create_from_ply("splats.ply")`` wants Open3D; the same splats are read from USD here.
"""

from pathlib import Path

_HERE = Path(__file__).parent


def gaussian(min_response: float = 1.0 / 255.0):
    """The splats as ``newton.Gaussian``; below ``min_response`` a splat's edge is cut off."""
    import newton
    from pxr import Usd

    stage = Usd.Stage.Open(str(_HERE / "splats.usdc"))
    return newton.Gaussian.create_from_usd(stage.GetDefaultPrim(), min_response=min_response)


def add_room(builder) -> int:
    """Adds the static collision surface and the splats to a ``newton.ModelBuilder``; the index of the splats' shape."""
    builder.add_usd(str(_HERE / "scene.usd"), load_visual_shapes=False, hide_collision_shapes=True)
    return builder.add_shape_gaussian(-1, gaussian=gaussian())
'''


def _write(room: ExportedRoom, folder: Path) -> None:
    for name in (SPLATS_PLY, SPLATS_USD):
        save_asset(folder / name, room.asset)
    shutil.copyfile(room.collision / SCENE_USD, folder / SCENE_USD)
    write_room_stage(folder, SCENE_USD, SPLATS_USD, None)
    write_text(folder / ROOM_PY, _ROOM_PY)


CONSUMER = Consumer(
    "newton",
    "for Newton: scene.usd, splats.usdc and room.usda of both, splats.ply, and room.py that loads them",
    _write,
)
