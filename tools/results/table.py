"""Print the README's table of results with the rows of evaluated scenes.

    python -m tools.results.table build/demo_room.r2s build/room_a.r2s ... [--write]

Each scene must have been through ``r2sego refine`` and ``r2sego evaluate``. ``--write`` puts the
table between the markers in README.md. Rows of scenes that are not named stay as they are, with
the date and the machine they were made on.
"""

from __future__ import annotations

import argparse
import datetime
import os
import re
from pathlib import Path

from r2sego_blender.bundle.figures import CAMERAS, METRICS
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import R2SEgoError
from r2sego_blender.core.resources import processor
from r2sego_blender.evaluation.arms import DEFAULT_ARMS, INITIAL, REFINED, strongest_baseline

README = Path(__file__).resolve().parents[2] / "README.md"
_ARMS = "vanilla 3DGS | GaussGym | same points | no generated views | refined"
BEGIN, END = "<!-- results: made by tools/results/table.py -->", "<!-- end of results -->"


def row(scene: Scene) -> str:
    """One scene as a line of the Markdown table."""
    arms = scene.read(METRICS)["arms"]
    captures = scene.read(CAMERAS)["captures"]
    scores = [f"{arms[arm]['psnr']:.2f} / {arms[arm]['ssim']:.3f}" for arm in DEFAULT_ARMS if arm != INITIAL]
    strongest = strongest_baseline({arm: scored["psnr"] for arm, scored in arms.items()})
    gain = arms[REFINED]["psnr"] - arms[strongest]["psnr"]
    views = len(arms["refined"]["views"])
    name, settings = scene.path.stem, scene.declaration
    changed = "".join(f" --set {key}={value}" for key, value in settings.overrides.items())
    return (
        f"| {name} | {len(captures)} | {views} | {' | '.join(scores)} | {gain:+.2f} "
        f"| `--preset {settings.preset}{changed}` |"
    )


def names_and_rows(text: str) -> dict[str, str]:
    """The rows of a table, by their scene."""
    rows = [line for line in text.splitlines() if line.startswith("|")][2:]  # after the heading and its rule
    return {line.split("|")[1].strip(): line for line in rows}


def when_made(text: str) -> dict[str, str]:
    """When and on which machine each row of a table was made, by its scene."""
    made: dict[str, str] = {}
    for when, named in re.findall(r"^Made on ([^:\n]*)(?:: (.*))?\.$", text, flags=re.MULTILINE):
        made |= dict.fromkeys(named.split(", ") if named else names_and_rows(text), when)
    return made


def table(scenes: list[Scene], before: str = "") -> str:
    """The whole table with its caption; rows of the one ``before`` stay for scenes not among ``scenes``."""
    rows, made = names_and_rows(before), when_made(before)
    now = f"{datetime.date.today().isoformat()}, {processor()}, {os.cpu_count()} cores"
    for scene in scenes:
        rows[scene.path.stem], made[scene.path.stem] = row(scene), now
    dates = list(dict.fromkeys(made[name] for name in rows if name in made))
    together = len(dates) == 1 and len(made) == len(rows)
    named = {date: ", ".join(name for name in rows if made.get(name) == date) for date in dates}
    lines = [
        f"| scene | captures | held out | {_ARMS} | gain, dB | with |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        *rows.values(),
        "",
        "PSNR in dB / SSIM, means over complete held-out views, no mask, no colour correction. Vanilla",
        "3DGS has the original's settings and densification, starts from the same observed points and trains on the",
        "same captures for as many steps, over black; *GaussGym* (its sparse-stable SH3 condition) does so without",
        "densification, *same points* also at this project's rates. None of the three has a budget of Gaussians, and",
        "the gain is over the best of them. *No generated views* is Algorithm 1 with its completed geometry and",
        "backdrop on captures alone: what refined has beyond it, generated views are worth.",
        *(f"Made on {date}." if together else f"Made on {date}: {named[date]}." for date in dates),
    ]
    return "\n".join(lines)


def main() -> None:
    """Read the command line and print the table, or write it into README.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="+", type=Path, help="an evaluated scene's bundle")
    parser.add_argument("--write", action="store_true", help="write the table into README.md")
    options = parser.parse_args()
    try:
        scenes = [Scene.open(path) for path in options.scene]
    except R2SEgoError as error:
        parser.error(str(error))
    for scene in scenes:
        if not set(DEFAULT_ARMS) <= set(scene.read(METRICS).get("arms", ())):
            parser.error(f"{scene.path}: its arms are not all scored yet. Run `r2sego evaluate {scene.path}` first.")
    head, begin, rest = README.read_text(encoding="utf-8").partition(BEGIN)
    before, end, tail = rest.partition(END)
    if not (begin and end):
        parser.error(f"{README}: there are no '{BEGIN}' and '{END}' to put the table between")
    made = table(scenes, before)
    if options.write:
        README.write_text(f"{head}{BEGIN}\n{made}\n{END}{tail}", encoding="utf-8")
    else:
        print(made)


if __name__ == "__main__":
    main()
