"""MuJoCo Playground 0.2: one XML and a dict of assets, of pieces few enough for MJX."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from ...core.text_files import write_text
from ...geometry.collision.collision_files import FLOOR, HULLS, SCENE_XML, obj_text, read_obj
from ...geometry.collision.merging import merged
from .consumer import ROOM_PY, Consumer, ExportedRoom

MOST_PIECES = 400
"""Beyond some hundreds MJX's compilation and steps take longer than they are worth."""

_ROOM_PY = '''"""The room for MuJoCo Playground: its XML and its assets, as an MjxEnv wants them.

    model = mujoco.MjModel.from_xml_string(xml(), assets=assets())

The floor's geom is called ``floor``. To stand a robot in it, ``<include file="scene.xml"/>`` in the robot's scene in
the place of its floor, and ``robot_assets | assets()``.
"""

from pathlib import Path

_HERE = Path(__file__).parent


def xml() -> str:
    """The scene's XML."""
    return (_HERE / "scene.xml").read_text()


def assets() -> dict[str, bytes]:
    """Each file of the scene by its name, as Playground's ``update_assets`` names them; the scene's XML too."""
    return {file.name: file.read_bytes() for file in [_HERE / "scene.xml", *sorted((_HERE / "hulls").glob("*.obj"))]}
'''


def _write(room: ExportedRoom, folder: Path) -> None:
    scene = ElementTree.parse(room.collision / SCENE_XML)
    assets, world = scene.find("asset"), scene.find("worldbody")
    assert assets is not None and world is not None  # written by ``collision_files``
    pieces = [read_obj(file) for file in sorted((room.collision / HULLS).glob("*.obj"))]
    if len(pieces) > MOST_PIECES:
        pieces = merged(pieces, MOST_PIECES)
    if len(pieces) > MOST_PIECES:
        room.progress.message(f"{folder.name}: {len(pieces)} pieces lie too far apart to be fewer", "warning")
    for mesh in assets.findall("mesh")[len(pieces) :]:
        assets.remove(mesh)
    for geom in [one for one in world.findall("geom") if one.get("name") != FLOOR][len(pieces) :]:
        world.remove(geom)
    (folder / HULLS).mkdir()
    for mesh, (vertices, faces) in zip(assets.findall("mesh"), pieces, strict=True):
        write_text(folder / str(mesh.get("file")), obj_text(vertices, faces))
    ElementTree.indent(scene)
    write_text(folder / SCENE_XML, ElementTree.tostring(scene.getroot(), encoding="unicode") + "\n")
    write_text(folder / ROOM_PY, _ROOM_PY)


CONSUMER = Consumer(
    "playground",
    f"for MuJoCo Playground: scene.xml of at most {MOST_PIECES} pieces, and room.py with its assets",
    _write,
)
