"""As much of a refined scene as publishing its asset reads, and the command line on it in this process."""

from pathlib import Path

import numpy as np
from bundles import new_bundle
from click.testing import CliRunner, Result

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands import cli
from r2sego_blender.core.progress import SILENT
from r2sego_blender.refine.steps import Steps
from r2sego_blender.splats.artifacts import ASSET
from r2sego_blender.splats.formats.ply import save_ply
from tools.benchmarks.workloads import made_up_room

ROOM = made_up_room(900, (64, 48))
CAMERA = ROOM.views[0].camera
BACKDROP = ROOM.asset.subset(np.arange(0, 900, 10)).with_degree(0)


def r2sego(monkeypatch, *arguments: object) -> Result:
    """The command's result; signals stay the tests' own."""
    monkeypatch.setattr(cli, "cancel_at_once", lambda _: None)
    return CliRunner().invoke(cli.main, list(map(str, arguments)))


def publish(scene: Scene) -> None:
    """The asset of round 0 as the refined one, as the last step does."""
    Steps(Runner(scene), scene.declaration.settings, SILENT).publish_asset(ASSET.of_round(0))


def refined_scene(folder: Path) -> Scene:
    """A scene of one round with its asset published, ``room.r2s`` in ``folder``."""

    def fill(folder: Path) -> None:
        for name in ("geometry", "rounds/0", "captures"):
            (folder / name).mkdir(parents=True)
        save_ply(folder / "rounds/0/asset.ply", ROOM.asset)
        save_ply(folder / "geometry/backdrop.ply", BACKDROP)
        save_ply(folder / "geometry/initial_asset.ply", ROOM.asset.subset(np.arange(100)))

    made = new_bundle(folder / "room.r2s", fill)
    publish(made)
    return made
