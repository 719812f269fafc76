"""Make docs/pictures/mujoco.jpg: the embedded humanoid in the demo room in MuJoCo, and what it sees.

r2sego export build/demo_room.r2s --to build/out
MUJOCO_GL=egl python -m tools.pictures.mujoco build/out
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np

from r2sego_blender.core.cameras import look_at
from r2sego_blender.evaluation.figures import save_figure, strip
from r2sego_blender.results.simulated_camera import SimulatedCamera
from r2sego_blender.robot.model.humanoid import humanoid_mjcf
from r2sego_blender.robot.model.mount import MUJOCO_FROM_OPENCV
from r2sego_blender.splats.formats.registry import load_asset

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures"
PLACE_M, YAW_DEG = (0.25, -1.0), 80.0
ELBOW_RAD = 0.0  # forearms forward, where the head camera sees them
BESIDE, TOWARDS = np.array([1.5, -1.9, 1.6]), np.array([0.2, 0.4, 0.75])


def room_with_robot(folder: Path) -> mujoco.MjModel:
    """The humanoid in an exported room's collision surface, which is not drawn."""
    robot = mujoco.MjSpec.from_string(humanoid_mjcf())
    room = mujoco.MjSpec.from_file(str(folder / "collision" / "scene.xml"))
    for geom in room.geoms:
        geom.group = 3
    robot.attach(room, prefix="room/", frame=robot.worldbody.add_frame())
    beside = look_at(BESIDE, TOWARDS)
    turn = np.empty(4)
    mujoco.mju_mat2Quat(turn, (beside[:3, :3] @ MUJOCO_FROM_OPENCV).ravel())
    robot.worldbody.add_camera(name="beside", pos=beside[:3, 3], quat=turn, fovy=60.0)
    return robot.compile()


def main(folder: Path) -> None:
    model, asset = room_with_robot(folder), load_asset(folder / "asset.ply")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    half_rad = np.radians(YAW_DEG) / 2
    data.qpos[:2], data.qpos[3:7] = PLACE_M, (np.cos(half_rad), 0, 0, np.sin(half_rad))
    for side in ("left", "right"):
        data.joint(f"{side}_elbow_joint").qpos = ELBOW_RAD
    mujoco.mj_forward(model, data)
    pictures = []
    for name in ("beside", "head_camera"):
        with SimulatedCamera(model, name, asset) as camera:
            pictures.append(camera.see(data).colour.astype(np.float32) / 255)
    save_figure(PICTURES / "mujoco.jpg", strip(pictures))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
