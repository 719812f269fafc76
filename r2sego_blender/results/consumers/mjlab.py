"""mjlab 1.6: the room as an entity whose ``spec_fn`` gives an MjSpec. Its cameras see meshes, and no splats."""

from __future__ import annotations

from pathlib import Path

from ...core.text_files import write_text
from .consumer import ROOM_PY, Consumer, ExportedRoom, copy_scene

_ROOM_PY = '''"""The room for mjlab: put ``room_cfg()`` among the entities of a scene.

    SceneCfg(entities={"robot": ..., "room": room_cfg()})
"""

from pathlib import Path

import mujoco


def spec_fn() -> mujoco.MjSpec:
    """The room below one fixed body, as mjlab wants an entity."""
    spec = mujoco.MjSpec()
    room = mujoco.MjSpec.from_file(str(Path(__file__).with_name("scene.xml")))
    spec.attach(room, prefix="scene/", frame=spec.worldbody.add_body(name="room").add_frame())
    return spec


def room_cfg():
    """An ``EntityCfg`` of mjlab, in the world frame of the export."""
    from mjlab.entity import EntityCfg

    return EntityCfg(spec_fn=spec_fn)
'''


def _write(room: ExportedRoom, folder: Path) -> None:
    copy_scene(room, folder)
    write_text(folder / ROOM_PY, _ROOM_PY)


CONSUMER = Consumer("mjlab", "for mjlab: scene.xml, and room.py with its spec_fn and EntityCfg", _write)
