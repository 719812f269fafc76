"""Nothing of the work needs a network, and nothing reaches for one: a demo from its photographs to its export."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from demo_views import write_first_views
from network_watch import watched

from tools.benchmarks.kills import FEW, ROOM

ROOT = Path(__file__).parents[1]
BATCH = ROOT / "batch"
PYTHON = (sys.executable, "-m", "r2sego_blender")


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("network") / "demo.r2s"


def reaches_for(log: Path, *command: object) -> list[object]:
    """What a command that succeeds reaches for beyond this machine."""
    # Telemetry of packages is off in CI by their own choice, which would hide that nothing else switches it off.
    environment = {name: value for name, value in os.environ.items() if name != "CI"} | {"PYTHONPATH": str(ROOT)}
    done, found = watched(command, log, env=environment, cwd=log.parent, capture_output=True, timeout_s=1200.0)
    assert done.returncode == 0, done.stderr[-2000:]
    return found


@pytest.mark.slow
def test_a_demo_reaches_for_nothing_beyond_this_machine(scene, tmp_path):
    few = [f"--set={setting}" for setting in FEW]
    frozen = write_first_views(tmp_path, 3)
    for step in (
        ["new", scene, "--captures", ROOM / "captures", "--poses", ROOM / "cameras.json", *few],
        ["refine", scene, "--preset", "preview", *few],
        ["evaluate", scene, "--frozen", frozen],
        ["export", scene, "--to", tmp_path / "out", "--textured"],
        ["doctor"],
    ):
        assert reaches_for(tmp_path / f"{step[0]}.log", *PYTHON, *step) == []


@pytest.mark.slow
def test_blenders_side_reaches_for_nothing_beyond_this_machine(bundle_path, tmp_path):
    pytest.importorskip("bpy", reason="pip bpy is not installed")
    script = [sys.executable, BATCH / "import_scene.py", "--", bundle_path, tmp_path / "room.blend"]
    assert reaches_for(tmp_path / "import.log", *script) == []
