"""The commands on what a refinement left: scored, exported, textured, and checked in MuJoCo."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ..bundle.layout import REPORT_PAGE
from ..bundle.scene import Scene
from ..config.presets import with_overrides
from .options import ANY_PATH, FOLDER, Output, output_options, overrides_of, settings_option


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--frozen",
    required=True,
    type=ANY_PATH,
    help="cameras.json with a 'frozen' list, or a folder of held-out photographs.",
)
@click.option("--arms", default="", metavar="NAME,NAME", help="Of the arms these alone, and the refined one.")
@click.option(
    "--distinct", is_flag=True, help="Refuse views that stand and look as a capture or a retained target does."
)
@click.option(
    "--baselines-only",
    is_flag=True,
    help="Methods of others alone, of a SCENE that need not be refined; writes report/baselines.json and no page.",
)
@output_options("--json-progress")
def evaluate(scene: Path, frozen: Path, arms: str, distinct: bool, baselines_only: bool, output: Output) -> None:
    """Score SCENE on frozen views against what it has to beat; writes report/metrics.json.

    Vanilla 3DGS, the same points at this project's rates, and Algorithm 1 without generated views are trained on
    the same photographs first, unless that was done before; difix3d_plus and genfusion are asked for by name, and
    need environments of their own (`r2sego doctor --backends`). Photographs that are held out must not have been among
    those of SCENE.
    """
    from ..evaluation import baselines
    from ..evaluation.arms import DEFAULT_ARMS, named_arms
    from ..evaluation.scene_evaluation import evaluate_scene, table

    chosen = named_arms([name.strip() for name in arms.split(",")]) if arms else ()
    opened = Scene.open(scene)
    if baselines_only:
        of_others = chosen or baselines.DEFAULT_BASELINES
        metrics = baselines.evaluate_baselines(opened, frozen, output.progress, of_others, distinct)
        output.show({"metrics": metrics}, lambda _: [baselines.table(metrics)])
        return
    metrics = evaluate_scene(opened, frozen, output.progress, chosen or DEFAULT_ARMS, distinct)
    page = opened.report_folder / REPORT_PAGE
    output.show({"metrics": metrics}, lambda _: [table(metrics), f"report: {page}"])


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option("--to", "folder", required=True, type=FOLDER, help="Folder to write, made if missing.")
@click.option(
    "--splats", default="", metavar=".SPZ,.GLB", help="The asset in these formats too; `r2sego convert --help` has all."
)
@click.option("--textured", is_flag=True, help="The proxy with baked colours too, for simulators.")
@click.option(
    "--for",
    "consumers",
    multiple=True,
    metavar="NAME",
    help="A folder for training code too: gaussgym, mjlab, mujoco-warp, newton or playground. May be repeated.",
)
@output_options("--json-progress")
def export(scene: Path, folder: Path, splats: str, textured: bool, consumers: tuple[str, ...], output: Output) -> None:
    """Copy SCENE's asset, collision surface and proxy to a folder other tools read.

    asset.ply, collision/ (MJCF, URDF, SDF, USD, OBJ, STL, GLB), proxy.ply, cameras.json, and about.txt,
    which says what each file is.
    """
    from ..results.export import export_scene

    suffixes = [f".{name.strip().lower().lstrip('.')}" for name in splats.split(",") if name.strip()]
    written = export_scene(Scene.open(scene), folder, suffixes, textured, output.progress, consumers)
    output.show({"files": [str(path) for path in written]}, lambda told: told["files"])


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--to",
    "file",
    type=ANY_PATH,
    metavar="FILE",
    help="A .glb, or an .obj with MuJoCo's scene beside it; by default textured_proxy.glb in SCENE.",
)
@click.option(
    "--faces", type=int, metavar="N", help="Faces at most, by default 30000; short for --set texture.faces=N."
)
@click.option(
    "--size", type=int, metavar="PX", help="Side of the texture, by default 2048; short for --set texture.size_px=PX."
)
@settings_option
@output_options("--json-progress")
def texture(
    scene: Path, file: Path | None, faces: int | None, size: int | None, overrides: tuple[str, ...], output: Output
) -> None:
    """Write SCENE's proxy as one mesh with a texture baked from the captures."""
    from ..results.texture import texture_scene

    opened = Scene.open(scene)
    shorts = {"texture.faces": faces, "texture.size_px": size}
    given = {key: value for key, value in shorts.items() if value is not None}
    settings = with_overrides({**overrides_of(overrides), **given}, opened.declaration.settings)
    figures = texture_scene(opened, settings, file, output.progress)
    output.show(figures.to_json(), lambda _: [figures.line()])


@click.command("check-collision")
@click.argument("scene", type=ANY_PATH)
@output_options("--json", "--json-progress")
def check_collision(scene: Path, output: Output) -> None:
    """Drop spheres on SCENE's collision surface in MuJoCo, and see that the robot stands.

    Ends with status 1 where that fails; with --json-progress the result says it.
    """
    from ..results.collision_report import check_scene, lines

    report = check_scene(Scene.open(scene), output.progress)
    output.show(report.to_json(), lambda _: lines(report))
    sys.exit(0 if report.passed or output.as_events else 1)  # as an event the result says it


COMMANDS = (evaluate, export, texture, check_collision)
