"""Copy a scene's results to a folder of files that other tools read."""

from __future__ import annotations

import shutil
from pathlib import Path

from .errors import SceneError
from .geometry.proxy import GeometryProxy
from .scene import Scene


def export_scene(scene: Scene, folder: Path) -> list[Path]:
    """Write the asset, the collision surface and the coloured proxy; returns what was written.

    ``asset.ply`` (3D Gaussians, Inria order), ``collision/`` (OBJ, STL, GLB, convex pieces
    and ``scene.xml`` for MuJoCo), ``proxy.ply`` (faces coloured by provenance) and
    ``cameras.json`` (the captures in the world frame). Raises SceneError when the scene
    has no result yet.
    """
    rounds = scene.rounds_done()
    if not scene.asset_file.is_file() or not scene.collision_folder.is_dir() or not rounds:
        raise SceneError(
            "there is nothing to export yet",
            where=scene.path,
            cure=f"Run `r2sego refine {scene.path}` first.",
        )
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy2(scene.asset_file, folder / "asset.ply")
    shutil.copy2(scene.captures_folder / "cameras.json", folder / "cameras.json")
    shutil.copytree(scene.collision_folder, folder / "collision", dirs_exist_ok=True)
    proxy = GeometryProxy.load(scene.round_folder(rounds - 1) / "proxy" / "proxy.npz")
    proxy.save_ply(folder / "proxy.ply")
    return [folder / name for name in ("asset.ply", "collision", "proxy.ply", "cameras.json")]
