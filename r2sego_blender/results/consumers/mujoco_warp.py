"""mujoco_warp 4.0: MuJoCo's scene, and the splats of degree 0 as its render context takes them."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from ...core.arrays import save_arrays
from ...core.text_files import write_text
from ...geometry.collision.collision_files import SCENE_XML
from ...splats.asset import SplatAsset
from ...splats.quaternions import unit_quaternions
from .consumer import ROOM_PY, Consumer, ExportedRoom, copy_scene

SPLATS_NPZ = "splats.npz"
_NOT_DRAWN = "3"  # a group that MuJoCo's cameras leave out: what is touched stands where the splats are seen
_ROOM_PY = '''"""The room for mujoco_warp: attach ``spec()`` to a robot's, and hand ``splats()`` to the render context.

    context = mujoco_warp.create_render_context(model, nworld, cam_res=(128, 96), render_rgb=True, **splats())

The convex pieces are in geom group 3, which is not drawn by default: they are touched, the splats are seen.
"""

from pathlib import Path

import mujoco
import numpy as np

_HERE = Path(__file__).parent


def spec() -> mujoco.MjSpec:
    """The collision surface, world frame, metres, Z up."""
    return mujoco.MjSpec.from_file(str(_HERE / "scene.xml"))


def splats() -> dict[str, np.ndarray]:
    """Arguments of ``create_render_context``: positions, rotations wxyz, scales and RGBA, float32."""
    with np.load(_HERE / "splats.npz") as arrays:
        return {name: arrays[name] for name in arrays.files}
'''


def splat_arrays(asset: SplatAsset) -> dict[str, np.ndarray]:
    """Arguments of mujoco_warp's ``create_render_context``, float32, of the harmonics' degree 0 alone.

    ``splat_position`` (N, 3), ``splat_rotation`` (N, 4) wxyz of length 1, ``splat_scale`` (N, 3) metres,
    ``splat_rgba`` (N, 4).
    """
    asset = asset.finite()
    return {
        "splat_position": asset.means.astype(np.float32),
        "splat_rotation": unit_quaternions(asset.quaternions).astype(np.float32),
        "splat_scale": np.exp(asset.log_scales).astype(np.float32),
        "splat_rgba": np.column_stack([np.maximum(asset.base_colours, 0.0), asset.opacities]).astype(np.float32),
    }


def _write(room: ExportedRoom, folder: Path) -> None:
    copy_scene(room, folder)
    scene = ElementTree.parse(folder / SCENE_XML)
    for geom in scene.iter("geom"):
        geom.set("group", _NOT_DRAWN)
    world = scene.find("worldbody")
    assert world is not None  # written by ``collision_files``
    # A render context without any drawn geom ends the process: a grain that nobody sees or touches.
    ElementTree.SubElement(
        world, "geom", name="grain", type="sphere", size="0.001", pos="0 0 -1", contype="0", conaffinity="0", group="0"
    )
    ElementTree.indent(scene)
    write_text(folder / SCENE_XML, ElementTree.tostring(scene.getroot(), encoding="unicode") + "\n")
    save_arrays(folder / SPLATS_NPZ, **splat_arrays(room.asset))
    write_text(folder / ROOM_PY, _ROOM_PY)


CONSUMER = Consumer(
    "mujoco-warp",
    "for mujoco_warp: scene.xml, splats.npz of harmonics of degree 0, and room.py that loads both",
    _write,
)
