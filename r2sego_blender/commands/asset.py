"""The commands on a scene's visual asset: pictures of it, and what is deleted from it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..bundle.asset_stages import FINAL, PASSES, Stage, stage_named
from ..bundle.layout import REFINED_ASSET
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..core.errors import AssetError
from ..core.progress import JsonProgress, Progress
from ..splats.asset_edits import ASSET_EDITS
from .options import ANY_PATH, FOLDER, json_progress, progress_of, show, tell

if TYPE_CHECKING:
    from ..splats.asset import SplatAsset


@click.command()
@click.argument("source", metavar="SCENE|ASSET", type=ANY_PATH)
@click.option(
    "--cameras",
    required=True,
    type=ANY_PATH,
    help="JSON with a list 'cameras' or 'captures'; for an ASSET also what it was trained on.",
)
@click.option("--to", "folder", required=True, type=FOLDER, help="Folder to write, made if missing.")
@click.option(
    "--round", "stage", default=FINAL, show_default=True, metavar="L",
    help="Which asset of SCENE: initial, a round's, from 0, or final.",
)  # fmt: skip
@click.option(
    "--pass", "passes", type=click.Choice(PASSES), multiple=True, help="Repeatable; by default colour."
)
@json_progress
@click.pass_context
def render(
    context: click.Context,
    source: Path,
    cameras: Path,
    folder: Path,
    stage: str,
    passes: tuple[str, ...],
    as_json: bool,
) -> None:
    """Render a scene's asset, or a splat file, exactly from given cameras.

    Writes a PNG for each camera and pass; alpha, depth (metres, 0 where nothing is) and normals (in the
    world) also as exact numbers in a camera's .npz.
    """
    from ..refine.splat_start import cameras_of_poses, holds_poses
    from ..splats.formats.registry import load_asset
    from ..splats.rendering.pictures import load_cameras, save_pictures

    progress = progress_of(context, as_json)
    # A scene's world is another than that of the poses it was made of.
    trained_on = not source.is_dir() and holds_poses(cameras)
    seen_from = cameras_of_poses(cameras) if trained_on else load_cameras(cameras)
    asset = _present_asset(Scene.open(source), stage) if source.is_dir() else load_asset(source)
    started = time.monotonic()
    files = save_pictures(asset, seen_from, folder, tuple(dict.fromkeys(passes)) or ("colour",), progress)
    seconds = round(time.monotonic() - started, 3)
    if isinstance(progress, JsonProgress):
        tell(progress, files=list(map(str, files)), gaussians=len(asset), seconds=seconds)
    else:
        for file in files:
            click.echo(file)


@click.command("edit-asset")
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--box", "boxes", multiple=True, type=ANY_PATH, metavar="FILE", help="What to delete: a box; repeatable."
)
@click.option(
    "--lasso", "lassos", multiple=True, type=ANY_PATH, metavar="FILE", help="What a lasso holds; repeatable."
)
@click.option(
    "--cells",
    "cells",
    multiple=True,
    type=ANY_PATH,
    metavar="FILE",
    help="What cells of a grid hold; repeatable.",
)
@click.option("--name", help="The edit's name; by default the next edit_001.")
@click.option("--remove", multiple=True, metavar="NAME", help="Take an edit back; repeatable.")
@click.option("--list", "listed", is_flag=True, help="Only say which edits there are.")
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def edit_asset(
    context: click.Context,
    scene: Path,
    boxes: tuple[Path, ...],
    lassos: tuple[Path, ...],
    cells: tuple[Path, ...],
    name: str | None,
    remove: tuple[str, ...],
    listed: bool,
    as_object: bool,
    as_json: bool,
) -> None:
    """Delete splats from SCENE's asset, now and whenever it is refined again.

    FILE is JSON: of --box it holds world_from_box (4x4) and half_extents (3); of --lasso camera,
    polygon_px, near_m and far_m; of --cells grid_from_world (4x4) and cells (K x 3).
    """
    from ..splats.asset_edits import (
        AssetEdit,
        edit_file,
        load_region,
        next_name,
        not_yet_deleted,
        save_edit,
    )

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    kinds = (("box", boxes), ("lasso", lassos), ("cells", cells))
    regions = tuple(load_region(file, kind) for kind, files in kinds for file in files)
    if not (regions or remove or listed):
        raise AssetError("nothing is to be edited", where="r2sego edit-asset", cure="Give --box or --list.")
    if regions or remove:
        with opened.locked():
            require_present_frame(opened, [REFINED_ASSET], "edited")
            # Damaged edits and assets and unknown names are refused before anything changes.
            staying = [one for one in opened.read(ASSET_EDITS) if one.name not in (*remove, name)]
            try:
                regions = not_yet_deleted(staying, regions)
            except AssetError:
                _publish_again(opened, progress)  # what deleted them may have been killed before it did
                raise
            gone = {edit_file(opened, one) for one in remove}
            if (last := _last_round(opened)) >= 0:
                _asset(stage_named(opened, str(last)))
            if regions:
                saved = save_edit(opened, AssetEdit(name or next_name(opened.path), regions))
                gone.discard(saved)  # one that takes a removed one's name stays
            for file in gone:
                file.unlink()
            _publish_again(opened, progress)
    show(progress, _described(opened), _lines, as_object)


def _present_asset(scene: Scene, name: str) -> SplatAsset:
    """The same as ``_asset``. Raises SceneError when it is of an earlier world frame."""
    stage = stage_named(scene, name)
    require_present_frame(scene, [stage.target], "rendered")
    return _asset(stage)


def _asset(stage: Stage) -> SplatAsset:
    """A bundle's asset at a stage, with the backdrop behind it."""
    from ..splats.formats.ply import load_made

    asset = load_made(stage.file)
    if stage.backdrop is None:
        return asset
    return asset.concatenated(load_made(stage.backdrop).with_degree(asset.degree))


def _publish_again(scene: Scene, progress: Progress) -> None:
    """The final asset anew; of a refinement that was cut off, made of its newest round."""
    from ..bundle.runner import Runner
    from ..refine.steps import Steps
    from ..splats.artifacts import ASSET

    last = _last_round(scene)
    if last >= 0:
        steps = Steps(Runner(scene), scene.declaration.settings, progress)
        steps.publish_asset(ASSET.of_round(last))


def _last_round(scene: Scene) -> int:
    """The round whose asset the final one is made of; -1 when none has ended yet."""
    return scene.rounds_of_result() - 1


def _described(scene: Scene) -> dict[str, Any]:
    """The edits, and what they delete of the final asset."""
    from ..splats.asset_edits import deleted_by
    from ..splats.formats.ply_vertices import vertex_count

    edits = scene.read(ASSET_EDITS)
    listed = [{"name": e.name, "regions": [r.to_json()["kind"] for r in e.regions]} for e in edits]
    last = _last_round(scene)
    if last < 0:
        return {"edits": listed}
    means = _asset(stage_named(scene, str(last))).means
    for edit, one in zip(edits, listed, strict=True):
        one["deleted"] = int(edit.deletes(means).sum())
    left = len(means) - int(deleted_by(edits, means).sum())
    published = vertex_count(scene.asset_file) if scene.asset_file.is_file() else 0
    return {"edits": listed, "gaussians": left, "before": len(means), "published": published}


def _lines(described: dict[str, Any]) -> list[str]:
    lines = []
    for one in described["edits"]:
        deleted = f", {one['deleted']} Gaussians" if "deleted" in one else ""
        lines.append(f"{one['name']}: {', '.join(one['regions'])}{deleted}")
    if "gaussians" in described:
        lines.append(f"asset.ply: {described['gaussians']} of {described['before']} Gaussians are left")
        if described["gaussians"] != described["published"]:  # an edit or a refinement was cut off
            lines.append(f"  it still holds {described['published']}: `r2sego refine` publishes it anew")
    return lines or ["no edits"]
