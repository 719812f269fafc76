"""Make docs/pictures/mujoco.jpg: the demo room in MuJoCo, the embedded humanoid in it, and what it sees.

r2sego export build/demo_room.r2s --to build/out --textured
MUJOCO_GL=egl python docs/pictures/make_mujoco_picture.py build/out
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np

from r2sego_blender.cameras import look_at
from r2sego_blender.evaluation.figures import save_figure, strip
from r2sego_blender.robot.humanoid import humanoid_mjcf

HERE = Path(__file__).resolve().parent
PLACE_M, YAW_DEG = (0.25, -1.0), 80.0
BESIDE, TOWARDS = (1.5, -1.9, 1.6), (0.2, 0.4, 0.75)
WIDTH_PX, HEIGHT_PX = 640, 480


def room_with_robot(folder: Path) -> mujoco.MjModel:
    """An exported room's surface and colours, and the humanoid in them."""
    robot = mujoco.MjSpec.from_string(humanoid_mjcf())
    surface = mujoco.MjSpec.from_file(str(folder / "collision" / "scene.xml"))
    for geom in surface.geoms:
        geom.group = 3
    textured = mujoco.MjSpec.from_file(str(folder / "textured" / "room.xml"))
    for prefix, room in (("surface/", surface), ("textured/", textured)):
        robot.attach(room, prefix=prefix, frame=robot.worldbody.add_frame())
    beside = look_at(BESIDE, TOWARDS)
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, (beside[:3, :3] @ np.diag([1.0, -1.0, -1.0])).ravel())
    robot.worldbody.add_camera(name="beside", pos=beside[:3, 3], quat=turn, fovy=60.0)
    return robot.compile()


def main(folder: Path) -> None:
    model = room_with_robot(folder)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    half_rad = np.radians(YAW_DEG) / 2
    data.qpos[:2], data.qpos[3:7] = PLACE_M, (np.cos(half_rad), 0, 0, np.sin(half_rad))
    mujoco.mj_forward(model, data)
    pictures = []
    with mujoco.Renderer(model, HEIGHT_PX, WIDTH_PX) as renderer:
        for camera in ("beside", "head_camera"):
            renderer.update_scene(data, camera)
            pictures.append(np.float32(renderer.render()) / 255)
    save_figure(HERE / "mujoco.jpg", strip(pictures))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
