"""The example of the room Report, with pip bpy."""

from functools import partial

import pytest
from example_runs import run_example

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_example, "report_scores.py")


def test_scores_rounds_and_causes_are_printed(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path)
    assert done.returncode == 0, done.stderr
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert "Refined 25.10 0.810 0.213" in lines
    assert "Round 1 23.90 0.780 n/a 0.30 dB below round 0" in lines
    assert "Wrong depth 41% of the error, 12% of the pixels" in lines


def test_without_an_evaluation_it_says_so(bundle_path, blender_environment):
    (bundle_path / "report" / "metrics.json").unlink()
    done = run(blender_environment, bundle_path)
    assert done.returncode == 1
    assert "has not been evaluated" in done.stderr and "Traceback" not in done.stderr
