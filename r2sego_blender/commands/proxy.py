"""``r2sego objects``, ``edit-proxy`` and ``coverage``: the geometry proxy and what it is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..bundle.scene import Scene
from ..core.errors import SettingsError
from .options import ANY_PATH, FOLDER, Output, names_of, output_options, overrides_of, round_option


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--masks",
    type=FOLDER,
    help="Masks of the objects, in place of those declared: a folder each, or numbered images. A name that "
    "is there already keeps its mesh, pose and decision.",
)
@click.option("--find", is_flag=True, help="Take what stands free in the observed geometry for objects.")
@click.option("--segment", metavar="WORDS", help="Let SAM 3 mask what WORDS, with commas between, name.")
@click.option("--library", type=FOLDER, help="Folder of meshes that shapes are looked for in.")
@click.option("--no-library", is_flag=True, help="Look for shapes in no folder any more.")
@click.option("--mesh", "meshes", multiple=True, metavar="NAME=FILE", help="An object's own mesh; repeatable.")
@click.option("--generate", multiple=True, metavar="NAME", help="Let SAM 3D make its mesh; repeatable.")
@click.option(
    "--place",
    multiple=True,
    metavar="NAME=FILE.json",
    help="Its pose by hand: world_from_own, 4 x 4, and locked; repeatable.",
)
@click.option("--lock", multiple=True, metavar="NAME", help="Hold an alignment as it is; repeatable.")
@click.option("--unlock", multiple=True, metavar="NAME", help="Align it again; repeatable.")
@click.option("--accept", multiple=True, metavar="NAME", help="Take its prior whatever its figures; repeatable.")
@click.option("--reject", multiple=True, metavar="NAME", help="Take no prior for it; repeatable.")
@click.option("--reconsider", multiple=True, metavar="NAME", help="Let its figures decide again; repeatable.")
@click.option("--remove", multiple=True, metavar="NAME", help="Take an object away, the last one too; repeatable.")
@output_options("--json")
def objects(scene: Path, output: Output, **given: Any) -> None:
    """Declare SCENE's objects for shape priors, and say what became of them.

    An object's mesh, aligned to what was observed of it, completes what no photograph shows. Without
    options it only says. Masks are PNG files called as the photographs.
    """
    from ..editing.object_priors import declare_objects, describe_objects, lines

    opened = Scene.open(scene)
    if given["segment"] is not None or any(given.values()):
        meshes, place = (
            {name: Path(file) for name, file in overrides_of(given.pop(key), form).items()}
            for key, form in (("meshes", "--mesh NAME=FILE"), ("place", "--place NAME=FILE.json"))
        )
        segment = given.pop("segment")
        words = () if segment is None else names_of(segment)
        if segment is not None and not words:
            raise SettingsError("no word is given", where="--segment", cure="For example --segment chair,table.")
        declare_objects(opened, **given, vocabulary=words, meshes=meshes, place=place)
    output.show(describe_objects(Scene.open(scene)), lines)


@click.command("edit-proxy")
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--cut",
    type=ANY_PATH,
    metavar="FILE.npz",
    help="Faces to cut away: the number round, and their corners (K x 3 x 3) in its proxy.",
)
@click.option("--draw", type=ANY_PATH, metavar="FILE", help="A mesh to add, in the world's metres; glTF is Y up.")
@click.option("--name", default="", help="What the edit is called; by default as its file.")
@click.option("--remove", multiple=True, metavar="NAME", help="Take an edit back; repeatable.")
@click.option("--list", "only_list", is_flag=True, help="Only say what edits there are.")
@output_options("--json", "--json-progress")
def edit_proxy(scene: Path, only_list: bool, output: Output, **given: Any) -> None:
    """Cut faces of SCENE's proxy away or draw surfaces; the next refine redoes what depends on it."""
    from ..editing.proxy_edits import describe_edits, lines
    from ..editing.proxy_edits import edit_proxy as change

    if given["name"] and not (given["cut"] or given["draw"]):
        raise SettingsError(
            f"nothing is cut or drawn that could be called '{given['name']}'",
            where="--name",
            cure="Give --cut FILE.npz or --draw FILE with it.",
        )
    opened = Scene.open(scene)
    if not only_list and (given["cut"] or given["draw"] or given["remove"]):
        change(opened, **given)
    output.show(describe_edits(opened), lines)


@click.command()
@click.argument("scene", type=ANY_PATH)
@round_option()
@output_options("--json", "--json-progress")
def coverage(scene: Path, round_index: int | None, output: Output) -> None:
    """Count, for each face of a round's proxy, the robot's views and the captures that see it.

    The counts stand in rounds/L/coverage.
    """
    from ..results.coverage_report import lines, measure_coverage

    opened = Scene.open(scene)
    with opened.locked():
        figures = measure_coverage(opened, round_index, output.progress)
    output.show(figures, lines)


COMMANDS = (objects, edit_proxy, coverage)
