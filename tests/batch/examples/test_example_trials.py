"""The example of the room Trials, with pip bpy and the real engine."""

from functools import partial

import pytest
from example_runs import run_with_engine

from r2sego_blender.trials.plan.study import freeze_plan, state_of
from r2sego_blender.trials.plan.trial_plan import TrialPlan

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "trials_session.py")


@pytest.fixture
def declaration(tmp_path):
    """Two policies, two trials each."""
    policies = "".join(
        f'[[policies]]\ncondition = "{condition}"\nseed = 1\nsha256 = "{digit * 64}"\n'
        for condition, digit in (("GaussGym", "a"), ("R2S-EGO", "b"))
    )
    file = tmp_path / "chairs.toml"
    file.write_text(f'name = "Chairs"\ntrials = 2\n[rules]\nsupport_s = 0.5\n{policies}')
    return file


def test_a_declaration_is_planned_and_its_poses_are_told(blender_environment, declaration, tmp_path):
    done = run(blender_environment, declaration, "--trial", 3, "--page", "--to", tmp_path / "poses.blend")
    assert done.returncode == 0, done.stderr
    plan = TrialPlan.load(declaration.with_suffix(".trials"))
    trial = plan.trials[2]
    assert f"4 trials, plan {plan.digest}" in done.stdout
    for name, pose in (("Robot", trial.robot_pose), (trial.chair, trial.chair_pose)):
        told = f"{name}, trial 3: {pose.x_m:.4f} {pose.y_m:.4f} m, {pose.heading_deg:.4f} degrees"
        assert told in done.stdout.replace("-0.0000", "0.0000"), (told, done.stdout)
    assert (tmp_path / "poses.blend").is_file()


def test_a_simulated_session_runs_to_its_end(blender_environment, declaration):
    done = run(blender_environment, declaration, "--run")
    assert done.returncode == 0, done.stderr
    study = declaration.with_suffix(".trials")
    assert state_of(study).begun


def test_a_study_is_ended_and_a_session_that_is_not_there_is_told(blender_environment, declaration):
    _, study = freeze_plan(declaration)
    done = run(blender_environment, study, "--tell", "ARM")
    assert done.returncode == 1
    assert "no session runs" in done.stderr and "Traceback" not in done.stderr
    done = run(blender_environment, study, "--end", "the gantry broke")
    assert done.returncode == 0, done.stderr
    assert state_of(study).reason == "the gantry broke"
