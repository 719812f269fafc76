"""The commands on what a refinement left: scored, exported, textured, and checked in MuJoCo."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..bundle.layout import REPORT_PAGE
from ..bundle.scene import Scene
from ..config.presets import with_overrides
from .options import ANY_PATH, FOLDER, json_progress, overrides_of, progress_of, settings_option, tell


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--frozen",
    required=True,
    type=ANY_PATH,
    help="cameras.json with a 'frozen' list, or a folder of held-out photographs.",
)
@json_progress
@click.pass_context
def evaluate(context: click.Context, scene: Path, frozen: Path, as_json: bool) -> None:
    """Score SCENE on frozen views against vanilla 3DGS; writes report/metrics.json.

    Vanilla 3DGS is trained on the same photographs first, unless that was done before. Photographs that
    are held out must not have been among those of SCENE.
    """
    from ..evaluation.scene_evaluation import evaluate_scene, table

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    metrics = evaluate_scene(opened, frozen, progress)
    if as_json:
        tell(progress, metrics=metrics)
    else:
        click.echo(table(metrics))
        click.echo(f"report: {opened.report_folder / REPORT_PAGE}")


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--to", "folder", required=True, type=FOLDER, help="Folder to write, made if missing.")
@click.option(
    "--splats",
    default="",
    metavar=".SPZ,.GLB",
    help="The asset in these formats too; `r2sego convert --help` has all.",
)
@click.option("--textured", is_flag=True, help="The proxy with baked colours too, for simulators.")
@json_progress
@click.pass_context
def export(
    context: click.Context, scene: Path, folder: Path, splats: str, textured: bool, as_json: bool
) -> None:
    """Copy SCENE's asset, collision surface and proxy to a folder other tools read.

    asset.ply, collision/ (MJCF, URDF, SDF, USD, OBJ, STL, GLB), proxy.ply, cameras.json, and about.txt,
    which says what each file is.
    """
    from ..results.export import export_scene

    progress = progress_of(context, as_json)
    suffixes = [f".{name.strip().lower().lstrip('.')}" for name in splats.split(",") if name.strip()]
    written = export_scene(Scene.open(scene), folder, suffixes, textured, progress)
    if as_json:
        tell(progress, files=[str(path) for path in written])
    else:
        for path in written:
            click.echo(path)


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--to", "file", type=ANY_PATH, metavar="FILE",
    help="A .glb, or an .obj with MuJoCo's scene beside it; by default textured_proxy.glb in SCENE.",
)  # fmt: skip
@click.option(
    "--faces", type=int, metavar="N",
    help="Faces at most, by default 30000; short for --set texture.faces=N.",
)  # fmt: skip
@click.option(
    "--size", type=int, metavar="PX",
    help="Side of the texture, by default 2048; short for --set texture.size_px=PX.",
)  # fmt: skip
@settings_option
@json_progress
@click.pass_context
def texture(
    context: click.Context,
    scene: Path,
    file: Path | None,
    faces: int | None,
    size: int | None,
    overrides: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write SCENE's proxy as one mesh with a texture baked from the captures."""
    from ..results.texture import texture_scene

    progress = progress_of(context, as_json)
    opened = Scene.open(scene)
    shorts = {"texture.faces": faces, "texture.size_px": size}
    given = {key: value for key, value in shorts.items() if value is not None}
    settings = with_overrides({**overrides_of(overrides), **given}, opened.declaration.settings)
    figures = texture_scene(opened, settings, file, progress)
    if as_json:
        tell(progress, **figures.to_json())
    else:
        click.echo(figures.line())


@click.command("check-collision")
@click.argument("scene", type=ANY_PATH)
@click.option("--json", "as_object", is_flag=True, help="As one JSON object.")
@json_progress
@click.pass_context
def check_collision(context: click.Context, scene: Path, as_object: bool, as_json: bool) -> None:
    """Drop spheres on SCENE's collision surface in MuJoCo, and see that the robot stands.

    Ends with status 1 where that fails; with --json-progress the result says it.
    """
    from ..results.collision_report import check_scene, lines

    progress = progress_of(context, as_json)
    report = check_scene(Scene.open(scene), progress)
    if as_json:
        tell(progress, **report.to_json())
    else:
        click.echo(json.dumps(report.to_json(), indent=1) if as_object else "\n".join(lines(report)))
    context.exit(0 if report.passed or as_json else 1)  # as JSON the result says it


RESULT_COMMANDS = (evaluate, export, texture, check_collision)
