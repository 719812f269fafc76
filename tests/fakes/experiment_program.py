"""Stands in for ``r2sego new``, ``refine`` and ``evaluate`` of an experiment's cell: small files, the same each time.

``FAKE_CONTROL`` names a folder: each finished command leaves a line in ``commands.log`` there; a file ``abort`` with
a number has that many refinements abort natively, ``hold`` lets those that wait for it go on, and with ``tamper``
an evaluation adds a frozen view. Arms that ``FAKE_NOT_SCORED`` names cannot be run here.
"""

import json
import os
import shutil
import sys
import time
import tomllib
from pathlib import Path

CONTROL = Path(os.environ["FAKE_CONTROL"])
SCENE = """format = 1
[captures]
source = "fake"
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


def option(name):
    return sys.argv[sys.argv.index(name) + 1]


def new(bundle):
    made = bundle.with_name(f".made-{os.getpid()}")
    (made / "captures").mkdir(parents=True)
    files = sorted(Path(option("--captures")).glob("*.png"))[: int(option("--first"))]
    for file in files:
        shutil.copy(file, made / "captures")
    (made / "scene.toml").write_text(SCENE)
    (made / ".lock").touch()
    (made / "journal.jsonl").write_text("")
    made.rename(bundle)


def refine(bundle):
    abort = CONTROL / "abort"
    if abort.is_file() and (left := int(abort.read_text())):
        abort.write_text(str(left - 1))
        (bundle / "asset.ply").write_text("half")
        os.abort()
    if (CONTROL / "held").is_file():
        (CONTROL / f"waiting-{os.getpid()}").touch()
        while not (CONTROL / "hold").is_file():
            time.sleep(0.02)
    (bundle / "asset.ply").write_text(json.dumps(described(bundle)))


def described(bundle):
    declared = tomllib.loads((bundle / "scene.toml").read_text())["settings"]
    return declared, sorted(file.name for file in (bundle / "captures").iterdir())


def evaluate(bundle):
    baselines_only = "--baselines-only" in sys.argv
    declared, captures = described(bundle) if baselines_only else json.loads((bundle / "asset.ply").read_text())
    seed, frozen = declared["overrides"]["seed"], sorted(Path(option("--frozen")).glob("*.png"))
    arms = {}
    for index, arm in enumerate(option("--arms").split(",")):
        psnr = 20.0 + index + 0.1 * len(captures) + 0.01 * ((7 * seed + 3 * index) % 11)
        views = [{"name": file.name, "psnr": psnr + number, "ssim": 0.5} for number, file in enumerate(frozen)]
        backend = {"backend": f"{arm} 1.0"} if arm in ("genfusion", "difix3d_plus") else {}
        arms[arm] = {
            **backend,
            "psnr": psnr,
            "ssim": 0.5 + 0.01 * index,
            "lpips_alex": None,
            "lpips_reason": "",
            "views": views,
        }
    if (CONTROL / "tamper").is_file():
        (Path(option("--frozen")) / "99.png").write_bytes(frozen[0].read_bytes() + b"more")
    (bundle / "report").mkdir(exist_ok=True)
    not_scored = {arm: "not set up" for arm in os.environ.get("FAKE_NOT_SCORED", "").split(",") if arms.pop(arm, None)}
    told = {"arms": arms, "assets": {"asset.ply": str(captures)}, "not_scored": not_scored}
    (bundle / "report" / ("baselines.json" if baselines_only else "metrics.json")).write_text(json.dumps(told))


if __name__ == "__main__":
    command, bundle = sys.argv[1], Path(sys.argv[2])
    {"new": new, "refine": refine, "evaluate": evaluate}[command](bundle)
    with (CONTROL / "commands.log").open("a") as log:
        log.write(f"{command} {os.getpid()} {bundle}\n")
