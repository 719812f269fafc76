"""A bundle of the made-up room with what rollouts read: captures, a proxy, a collision surface."""

from pathlib import Path

import numpy as np
from bundles import new_bundle

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.collision.collision_files import write_collision
from tools.benchmarks.workloads import made_up_collision, made_up_path, made_up_proxy, made_up_room


def made_up_bundle(path: Path, **overrides: object) -> Scene:
    """The bundle at ``path``; its round 0 ends with the collision surface."""
    lens = made_up_room(0, (640, 480)).views[0].camera.scaled(0.1)

    def fill(folder: Path) -> None:
        picture = folder / "grey.png"
        save_image(picture, np.full((*lens.shape, 3), 0.5, np.float32))
        views = enumerate(made_up_path(lens, 8))
        save_captures(folder / "captures", [Capture(f"{k}.png", picture, camera) for k, camera in views])
        picture.unlink()
        for name in ("proxy", "collision"):
            (folder / "rounds" / "0" / name).mkdir(parents=True)
        made_up_proxy(5000).save(folder / "rounds" / "0" / "proxy" / "proxy.npz")
        write_collision(made_up_collision(), folder / "rounds" / "0" / "collision")

    settings = {"rollouts.processes": 1, **overrides}
    return new_bundle(path, fill, overrides=settings)
