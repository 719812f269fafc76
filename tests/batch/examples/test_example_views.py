"""The example of the room Views, with pip bpy."""

import subprocess
import sys
from functools import partial

import fake_bundle
import pytest
from example_runs import run_example

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_example, "views_candidates.py")


def test_the_targets_are_shown_and_explained(bundle_path, blender_environment, tmp_path):
    blend = tmp_path / "views.blend"
    done = run(blender_environment, bundle_path, "--round", 0, "--colour", "u", "--blend", blend)
    assert done.returncode == 0, done.stderr
    best = fake_bundle.TARGETS[0]
    assert f"1. rollout {best // 10}, frame {best % 10}: u" in done.stdout
    assert f"looking through candidate {best}: Because. Its reference capture_1" in done.stdout
    look = f"import bpy; bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); print(bpy.context.scene.camera)"
    opened = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True)
    assert "Candidate view" in opened.stdout, opened.stderr


def test_what_cannot_be_is_told_in_one_line(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "--candidate", 99)
    assert done.returncode == 1
    assert "There is no candidate 99" in done.stderr and "Traceback" not in done.stderr
