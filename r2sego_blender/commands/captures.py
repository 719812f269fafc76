"""``r2sego register``: where its floor lies, which way is up, how long a metre is; ``estimate-depth``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from ..bundle.scene import Scene
from ..core.errors import SettingsError
from .options import ANY_PATH, FOLDER, Output, direction_of, output_options, scale_of, scale_options


@click.command()
@click.argument("scene", type=ANY_PATH)
@click.option(
    "--floor",
    multiple=True,
    metavar="PHOTO:X,Y[=PHOTO:X,Y]",
    help="A point of the floor in one photograph of the bundle, or the same spot in several; repeatable: "
    "three tell the floor's tilt, one its height.",
)
@click.option("--up", metavar="X,Y,Z", help="The direction up, as the world is now.")
@click.option("--floor-at", type=float, metavar="METRES", help="Where the floor lies above the z = 0 of now.")
@scale_options
@click.option("--picks", type=ANY_PATH, metavar="FILE.json", help="Points, lengths and heights, fitted together.")
@click.option("--frame", metavar="12 NUMBERS", help="The new world's pose in that of now: rows of a 3x4, with commas.")
@click.option("--undo", is_flag=True, help="Take the last correction back.")
@output_options("--json-progress")
def register(
    scene: Path,
    floor: tuple[str, ...],
    up: str | None,
    floor_at: float | None,
    picks: Path | None,
    frame: str | None,
    undo: bool,
    output: Output,
    **given: Any,
) -> None:
    """Correct SCENE's ground or scale; what depends on it is redone by the next refine.

    SCENE/report/ground shows where the floor was found. Pixels are those of SCENE/captures/images, from
    the upper left corner.
    """
    from ..captures.frame.floor_points import FloorPoint
    from ..captures.frame.picks import Picks
    from ..editing.correction import correct_by_picks, correct_registration, correct_to_frame, undo_correction

    single = bool(floor) or up is not None or floor_at is not None or any(v is not None for v in given.values())
    if single + (picks is not None) + (frame is not None) + undo > 1:
        raise SettingsError(
            "the correction is given in two ways",
            where="r2sego register",
            cure="Give --picks, or --frame, or --undo, or single options.",
        )
    opened = Scene.open(scene)
    told: dict[str, Any] = {}
    if picks is not None:
        made, fit = correct_by_picks(opened, Picks.load(picks), output.progress)
        told = {"residuals": fit.to_json()} if output.as_events else {}
        for line in fit.lines():
            output.progress.message(line)
    elif frame is not None:
        made = correct_to_frame(opened, _frame_of(frame))
    elif undo:
        made = undo_correction(opened)
    else:
        made = correct_registration(
            opened,
            floor=[FloorPoint.parse(text) for text in floor],
            up=None if up is None else direction_of(up),
            floor_at_m=floor_at,
            scale=scale_of(**given, robot=opened.declaration.robot, scope=opened.declaration.scope, command="register"),
            progress=output.progress,
        )
    declared = made.declaration
    output.tell(scene=str(made.path), ground=declared.ground, scale=declared.scale_source, **told)


@click.command("estimate-depth")
@click.argument("scene", type=ANY_PATH)
@click.option("--recorded", type=FOLDER, help="Maps called as the photographs are: EXR, NPY, NPZ, PNG or TIFF.")
@click.option("--backend", metavar="NAME", help="A model that is set up here: `r2sego doctor --backends`.")
@click.option("--inverse", is_flag=True, help="Recorded ones hold inverse depth, as of many models of one photograph.")
@click.option("--remove", is_flag=True, help="Take the maps away.")
@output_options("--json", "--json-progress")
def estimate_depth(
    scene: Path, recorded: Path | None, backend: str | None, inverse: bool, remove: bool, output: Output
) -> None:
    """Record depth maps of any origin for SCENE, or have a model estimate them; the next refine fills with them what
    nothing else knows.

    Maps may be in any unit, each with a scale and a shift of its own: they are aligned to what stereo, sensors
    and sparse points know. Without options it only says which there are.
    """
    from ..editing import recorded_depth

    if remove + (recorded is not None) + (backend is not None) > 1 or (inverse and recorded is None):
        raise SettingsError(
            "--remove takes maps away, --inverse says what given ones hold, and --backend makes others",
            where="r2sego estimate-depth",
            cure="Give --recorded FOLDER, with --inverse or without, or --backend NAME, or --remove alone.",
        )
    opened = Scene.open(scene)
    if recorded is not None:
        opened = recorded_depth.record_depth(opened, recorded, inverse)
    elif backend is not None:
        opened = recorded_depth.estimate_depth(opened, backend, output.progress)
    elif remove:
        opened = recorded_depth.remove_depth(opened)
    output.show(recorded_depth.describe_recorded(opened), recorded_depth.lines)


COMMANDS = (register, estimate_depth)


def _frame_of(text: str) -> np.ndarray:
    """The (4, 4) pose in a text of 12 numbers. Raises SettingsError."""
    try:
        rows = np.array([float(number) for number in text.split(",")]).reshape(3, 4)
    except ValueError as error:
        raise SettingsError(
            f"'{text}' is not 12 numbers", where="--frame", cure="For example --frame 1,0,0,0,0,1,0,0,0,0,1,-0.02."
        ) from error
    return np.vstack([rows, [0.0, 0.0, 0.0, 1.0]])
