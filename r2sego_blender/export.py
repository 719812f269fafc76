"""Copy a scene's results to a folder of files that other tools read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from .errors import AssetError, SceneError
from .geometry.proxy import GeometryProxy
from .layout import COLLISION, REFINED_ASSET, of_round
from .scene import Scene
from .splats.formats import SUFFIXES, load_asset, save_asset
from .world_frame import require_present_frame


def export_scene(scene: Scene, folder: Path, splats: Sequence[str] = ()) -> list[Path]:
    """Write the asset, the collision surface and the coloured proxy; returns what was written.

    ``asset.ply`` (3D Gaussians, Inria order), ``collision/`` (OBJ, STL, GLB, convex pieces,
    ``scene.xml`` for MuJoCo, ``scene.urdf`` and ``scene.usd`` with physics), ``proxy.ply`` (faces
    coloured by provenance) and ``cameras.json`` (the captures in the world frame; it names the
    photographs as the scene's folder ``captures`` has them, and says so); the asset
    once more for each suffix in ``splats``, such as ``.spz`` (docs/splat_formats.md).
    Nothing appears before all of it is written; a ``collision`` that was there goes. Raises
    SceneError when the scene has no result yet, one of a world frame that was corrected since, or
    one that was damaged or changed since, and for a folder inside the scene; AssetError for a
    suffix that is no format of splats.
    """
    for suffix in splats:
        if suffix not in SUFFIXES:
            raise AssetError(
                f"'{suffix}' is no format of splats", where="--splats", cure=f"Use {', '.join(SUFFIXES)}."
            )
    rounds = scene.rounds_of_result()
    if not scene.asset_file.is_file() or not scene.collision_folder.is_dir() or not rounds:
        raise SceneError(
            "there is nothing to export yet",
            where=scene.path,
            cure=f"Run `r2sego refine {scene.path}` first.",
        )
    if folder.resolve().is_relative_to(scene.path.resolve()):
        raise SceneError(
            "a scene is not exported into itself", where=folder, cure="Choose a folder outside the scene."
        )
    require_present_frame(scene, [REFINED_ASSET, COLLISION, of_round(rounds - 1, "proxy")], "exported")
    scene.require_as_made(REFINED_ASSET, COLLISION)
    folder.mkdir(parents=True, exist_ok=True)
    staging = folder / ".unfinished-export"
    shutil.rmtree(staging, ignore_errors=True)
    try:
        names = _write(scene, staging, scene.round_folder(rounds - 1), splats)
        for name in names:
            _replace(staging / name, folder / name)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return [folder / name for name in names]


def _write(scene: Scene, folder: Path, last_round: Path, splats: Sequence[str]) -> list[str]:
    """Write everything into a new folder; returns the names."""
    folder.mkdir()
    shutil.copy2(scene.asset_file, folder / "asset.ply")
    _write_cameras(scene.captures_folder / "cameras.json", folder / "cameras.json")
    shutil.copytree(scene.collision_folder, folder / "collision")
    GeometryProxy.load(last_round / "proxy" / "proxy.npz").save_ply(folder / "proxy.ply")
    names = ["asset.ply", "collision", "proxy.ply", "cameras.json"]
    asset = load_asset(scene.asset_file) if splats else None
    for suffix in splats:
        if (name := f"asset{suffix}") not in names:
            save_asset(folder / name, asset)
            names.append(name)
    return names


def _write_cameras(source: Path, file: Path) -> None:
    """The captures' cameras; it says where the photographs are, which are not exported."""
    try:
        cameras = dict(json.loads(source.read_text(encoding="utf-8")))
    except (OSError, TypeError, ValueError) as error:
        raise SceneError("the captures' cameras cannot be read", where=source) from error
    about = f"{cameras.get('about', '')} The photographs are in the scene's folder 'captures'.".strip()
    file.write_text(json.dumps(cameras | {"about": about}, indent=1) + "\n", encoding="utf-8")


def _replace(made: Path, place: Path) -> None:
    if place.is_dir():
        shutil.rmtree(place)
    made.replace(place)
