"""Make docs/pictures/demo.jpg from an evaluated demo scene:

python -m tools.pictures.demo build/demo_room.r2s

Two frozen robot views, each as truth, vanilla 3DGS and refined, and the plan of the proxy.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.images import resize
from r2sego_blender.evaluation.arms import ARMS
from r2sego_blender.evaluation.figures import save_figure, strip, top_view
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.splats.formats.ply import load_ply
from r2sego_blender.splats.rendering.rasterizer import render

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
FROZEN = ROOT / "demo" / "room" / "cameras.json"
SHOWN = (3, 11)
HEIGHT_PX = 360


def main(scene: Scene) -> None:
    views = frozen_views(scene, FROZEN).views
    assets = [load_ply(scene.path / ARMS[arm].asset) for arm in ("vanilla_3dgs", "refined")]
    rows = []
    for index in SHOWN:
        camera = views[index].camera
        pictures = [views[index].image(), *(np.clip(render(a, camera).colour, 0, 1) for a in assets)]
        rows.append(strip([resize(p, 480, HEIGHT_PX) for p in pictures]))
    save_figure(PICTURES / "demo.jpg", np.concatenate(rows))
    proxy = scene.read(PROXY.of_round(scene.rounds_done() - 1))
    save_figure(PICTURES / "proxy.jpg", top_view(proxy).image)


if __name__ == "__main__":
    main(Scene.open(Path(sys.argv[1])))
