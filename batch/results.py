"""Write the README's table of results from evaluated scenes.

    python batch/results.py build/demo_room.r2s build/room_a.r2s ...

Each scene must have been through ``r2sego refine`` and ``r2sego evaluate``; the table stands
between the markers in README.md, with the date and this machine.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
from pathlib import Path

from r2sego_blender.benchmarks.machine import processor
from r2sego_blender.errors import R2SEgoError
from r2sego_blender.scene import Scene

README = Path(__file__).resolve().parents[1] / "README.md"
BEGIN, END = "<!-- results: made by batch/results.py -->", "<!-- end of results -->"


def row(scene: Scene) -> str:
    """One scene as a line of the Markdown table."""
    arms = json.loads(scene.metrics_file.read_text())["arms"]
    captures = json.loads((scene.captures_folder / "cameras.json").read_text())["captures"]
    scores = [
        f"{arms[a]['psnr']:.2f} / {arms[a]['ssim']:.3f}" for a in ("initial", "vanilla_3dgs", "refined")
    ]
    gain = arms["refined"]["psnr"] - arms["vanilla_3dgs"]["psnr"]
    views = len(arms["refined"]["views"])
    name, settings = scene.path.stem, scene.declaration
    changed = "".join(f" --set {key}={value}" for key, value in settings.overrides.items())
    return (
        f"| {name} | {len(captures)} | {views} | {' | '.join(scores)} | {gain:+.2f} "
        f"| `--preset {settings.preset}{changed}` |"
    )


def table(scenes: list[Scene]) -> str:
    """The whole table with its caption."""
    lines = [
        "| scene | captures | held out | initial asset | vanilla 3DGS | refined | gain, dB | refined with |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(row(scene) for scene in scenes),
        "",
        "PSNR in dB / SSIM, means over complete held-out views, no mask or correction. Vanilla 3DGS has the",
        "original's settings and densification; it starts from the same observed points and trains on the",
        "same captures for as many steps, over black. Refined includes its backdrop.",
        f"Made on {datetime.date.today().isoformat()}, {processor()}, {os.cpu_count()} cores.",
    ]
    return "\n".join(lines)


def main() -> None:
    """Read the command line and write the table into README.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="+", type=Path, help="an evaluated scene's bundle")
    paths = parser.parse_args().scene
    try:
        scenes = [Scene.open(path) for path in paths]
    except R2SEgoError as error:
        parser.error(str(error))
    for scene in scenes:
        if not scene.metrics_file.is_file():
            parser.error(f"{scene.path}: not evaluated yet. Run `r2sego evaluate {scene.path}` first.")
    text = README.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    README.write_text(f"{before}{BEGIN}\n{table(scenes)}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
