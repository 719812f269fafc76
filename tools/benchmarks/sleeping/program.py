"""Stands in for the commands of an experiment's cell: small files, and steps that sleep for as long as declared.

    python -S -m ... WORK new|refine|evaluate BUNDLE ...

``WORK/steps.json`` has the steps of each command and their seconds, and by how much scenes differ; a finished command
leaves a line in ``WORK/commands.log``. A refinement that was cut off goes on at the step where it stood. Python's own
library alone, so that it starts at once.
"""

import json
import sys
import time
import zlib
from pathlib import Path

SCENE = """format = 1
[captures]
source = "sleeping"
[registration]
ground = "floor"
scale_source = "metric"
world_from_capture = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
[robot]
model = "embedded:humanoid"
scope = "walk_and_look"
[priors]
mesh_library = ""
[settings]
preset = "paper"
[settings.overrides]
[backends]
"""


def scene_factor(name: str, spread: float) -> float:
    """How much longer a scene of that name takes than declared: 1 - spread to 1 + spread, the same each time."""
    return 1.0 + spread * (2.0 * zlib.crc32(name.encode()) / 0xFFFFFFFF - 1.0)


def _sleep_through(command: str, bundle: Path, declared: dict) -> None:
    """The steps of a command that the bundle's journal does not have yet."""
    name = bundle.parts[-4] if bundle.name == "bundle.r2s" else bundle.parts[-2]
    factor = scene_factor(name, declared["spread"])
    journal = bundle / "journal.jsonl"
    there = {json.loads(line)["step"] for line in journal.read_text().splitlines()} if journal.is_file() else set()
    for step, seconds in declared["steps"][command]:
        if step in there:
            continue
        time.sleep(seconds * factor)
        if bundle.is_dir():
            record = {"step": step, "inputs": "", "output": "", "seconds": seconds * factor}
            longer = journal.with_name(".unfinished-journal")  # in its place, as it may be a link to another bundle's
            longer.write_text(journal.read_text() + json.dumps(record) + "\n")
            longer.replace(journal)


def _new(bundle: Path) -> None:
    (bundle / "captures").mkdir(parents=True)
    (bundle / "scene.toml").write_text(SCENE)
    (bundle / ".lock").touch()
    (bundle / "journal.jsonl").touch()


def _evaluate(bundle: Path) -> None:
    """Scores that tell the cell."""
    arms = sys.argv[sys.argv.index("--arms") + 1].split(",")
    psnr = 20.0 + zlib.crc32("/".join(bundle.parts[-5:]).encode()) % 1000 / 100.0
    views = [{"name": "view.png", "psnr": psnr, "ssim": 0.5}]
    scores = {arm: {"psnr": psnr, "ssim": 0.5, "lpips_alex": None, "views": views} for arm in arms}
    (bundle / "report").mkdir(exist_ok=True)
    (bundle / "report/metrics.json").write_text(json.dumps({"arms": scores, "assets": {}}))


def main() -> None:
    """The command line."""
    work, command, bundle = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    _sleep_through(command, bundle, json.loads((work / "steps.json").read_text()))
    if command == "new":
        _new(bundle)
    if command == "evaluate":
        _evaluate(bundle)
    with (work / "commands.log").open("a") as log:
        log.write(f"{command} {bundle}\n")


if __name__ == "__main__":
    main()
