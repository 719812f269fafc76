"""What pictures of a scene's asset, or of any splats, are rendered from."""

from __future__ import annotations

from pathlib import Path

from ..bundle.asset_stages import FINAL, stage_named
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..core.cameras import Camera
from ..core.images import image_files
from ..core.progress import SILENT, Progress
from ..refine.splat_start import holds_poses, posed_photographs
from ..splats.artifacts import load_stage
from ..splats.asset import SplatAsset
from ..splats.formats.registry import load_asset
from ..splats.rendering.pictures import camera_entries, cameras_of, distorted_lenses, photographs_of


def asset_and_cameras(
    source: Path, cameras: Path, stage: str = FINAL, progress: Progress = SILENT
) -> tuple[SplatAsset, dict[str, Camera], list[Path]]:
    """The asset of a scene at a stage, or of a splat file; the cameras in a file, by their names; and the
    photographs that lie with them.

    Of a splat file the cameras may also be the poses of what it was trained on: a scene's world is another
    than that of the poses it was made of. Raises SceneError when a scene's asset is of an earlier world
    frame, and as ``stage_named``, ``load_asset``, ``camera_entries`` and ``cameras_of``.
    """
    if not source.is_dir() and holds_poses(cameras):
        posed = posed_photographs(cameras)
        seen_from = {capture.name.replace("/", "_"): capture.camera for capture in posed}
        return load_asset(source, progress), seen_from, [capture.image_path for capture in posed]
    entries = camera_entries(cameras)
    seen_from = cameras_of(entries, cameras)
    photographs = [*image_files(cameras.resolve().parent), *photographs_of(entries, cameras)]
    if count := distorted_lenses(entries):
        progress.message(f"{cameras}: the distortion of {count} lenses is left out: a pinhole is rendered", "warning")
    if not source.is_dir():
        return load_asset(source, progress), seen_from, photographs
    scene = Scene.open(source)
    found = stage_named(scene, stage)
    require_present_frame(scene, [found.target], "rendered")
    return load_stage(found), seen_from, photographs
