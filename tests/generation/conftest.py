"""The synthetic box room beside the tests, and the furnished room with ground truth."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOM_A = Path(__file__).resolve().parents[2] / "../shared/scenes/room_a"


@pytest.fixture(scope="session")
def box_room(tmp_path_factory):
    """Four photographs of the box room with exact depths, and its condition renderer."""
    import box_room

    from r2sego_blender.generation.conditions.conditions import ZBufferRenderer

    folder = tmp_path_factory.mktemp("box_room")
    captures, depths = box_room.write_captures(folder, box_room.arc(4))
    return SimpleNamespace(captures=captures, depths=depths, renderer=ZBufferRenderer(box_room.proxy()))


@pytest.fixture(scope="session")
def room_a():
    """The furnished room: captures and frozen views with their true depths, and its mesh."""
    from room_meshes import observed_proxy

    from r2sego_blender.captures.capture import Capture
    from r2sego_blender.core.cameras import Camera
    from r2sego_blender.generation.conditions.conditions import ZBufferRenderer

    if not (ROOM_A / "cameras.json").is_file():
        pytest.skip(f"no ground truth at {ROOM_A}")
    about = json.loads((ROOM_A / "cameras.json").read_text())
    size = {name: about[name] for name in ("width", "height", "fx", "fy", "cx", "cy")}

    def views(key, prefix):
        entries = about[key]
        cameras = [Camera.from_json(size | entry) for entry in entries]
        captures = [Capture(e["file"], ROOM_A / e["file"], c) for e, c in zip(entries, cameras, strict=True)]
        depths = [np.load(ROOM_A / f"depth/{prefix}{i:02d}.npz")["z"].astype(np.float32) for i in range(len(entries))]
        return captures, depths

    captures, depths = views("captures", "cap")
    frozen, frozen_depths = views("frozen", "ego")
    mesh = np.load(ROOM_A / "room.npz")
    return SimpleNamespace(
        captures=captures,
        depths=depths,
        frozen=frozen,
        frozen_depths=frozen_depths,
        renderer=ZBufferRenderer(observed_proxy(mesh["V"], mesh["F"])),
    )
