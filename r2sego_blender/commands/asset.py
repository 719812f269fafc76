"""``r2sego render`` and ``edit-asset``: pictures of a visual asset, and what is deleted from it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from ..bundle.asset_stages import FINAL, PASSES
from ..bundle.scene import Scene
from ..core.errors import AssetError
from .options import ANY_PATH, FOLDER, Output, output_options


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
    "--round",
    "stage",
    default=FINAL,
    show_default=True,
    metavar="L",
    help="Which asset of SCENE: initial, a round's, from 0, or final.",
)
@click.option("--pass", "passes", type=click.Choice(PASSES), multiple=True, help="Repeatable; by default colour.")
@output_options("--json-progress")
def render(source: Path, cameras: Path, folder: Path, stage: str, passes: tuple[str, ...], output: Output) -> None:
    """Render a scene's asset, or a splat file, exactly from given cameras.

    Writes a PNG for each camera and pass; alpha, depth (metres, 0 where nothing is) and normals (in the
    world) also as exact numbers in a camera's .npz.
    """
    from ..bundle.containment import require_outside
    from ..results.renderings import asset_and_cameras
    from ..splats.rendering.pictures import save_pictures

    require_outside(folder)
    asset, seen_from, photographs = asset_and_cameras(source, cameras, stage, output.progress)
    started = time.monotonic()
    passes = tuple(dict.fromkeys(passes)) or ("colour",)
    written = save_pictures(asset, seen_from, folder, passes, output.progress, photographs)
    seconds = round(time.monotonic() - started, 3)
    told: dict[str, Any] = {"files": list(map(str, written)), "gaussians": len(asset), "seconds": seconds}
    output.show(told, lambda told: told["files"])


@click.command("edit-asset")
@click.argument("scene", type=ANY_PATH)
@click.option("--box", "boxes", multiple=True, type=ANY_PATH, metavar="FILE", help="What to delete: a box; repeatable.")
@click.option("--lasso", "lassos", multiple=True, type=ANY_PATH, metavar="FILE", help="What a lasso holds; repeatable.")
@click.option(
    "--cells", "cells", multiple=True, type=ANY_PATH, metavar="FILE", help="What cells of a grid hold; repeatable."
)
@click.option("--name", help="The edit's name; by default the next edit_001.")
@click.option("--remove", multiple=True, metavar="NAME", help="Take an edit back; repeatable.")
@click.option("--list", "listed", is_flag=True, help="Only say which edits there are.")
@output_options("--json", "--json-progress")
def edit_asset(
    scene: Path,
    boxes: tuple[Path, ...],
    lassos: tuple[Path, ...],
    cells: tuple[Path, ...],
    name: str | None,
    remove: tuple[str, ...],
    listed: bool,
    output: Output,
) -> None:
    """Delete splats from SCENE's asset, now and whenever it is refined again.

    FILE is JSON: of --box it holds world_from_box (4x4) and half_extents (3); of --lasso camera,
    polygon_px, near_m and far_m; of --cells grid_from_world (4x4) and cells (K x 3).
    """
    from ..editing.asset_edits import describe_edits, lines
    from ..editing.asset_edits import edit_asset as change
    from ..splats.asset_edits import load_region

    opened = Scene.open(scene)
    kinds = (("box", boxes), ("lasso", lassos), ("cells", cells))
    regions = [load_region(file, kind) for kind, files in kinds for file in files]
    if not (regions or remove or listed):
        raise AssetError("nothing is to be edited", where="r2sego edit-asset", cure="Give --box or --list.")
    if regions or remove:
        change(opened, regions, name, remove, output.progress)
    output.show(describe_edits(opened), lines)


COMMANDS = (render, edit_asset)
