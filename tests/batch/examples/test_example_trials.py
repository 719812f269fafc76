"""The example of the room Trials, with pip bpy and the real engine."""

import json
import subprocess
import sys
import threading
import time
from functools import partial

import pytest
from example_runs import run_with_engine

from r2sego_blender.trials.line.simulated import simulated_calibration, simulated_device
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.study import freeze_plan, state_of
from r2sego_blender.trials.plan.trial_plan import TrialPlan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.running.live import Live, State

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
    file.write_text(f'name = "Chairs"\ntrials = 2\n[rules]\nsupport_s = 2.0\n{policies}')
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


class Session:
    """A session in a process of its own; ``live`` is what it told last."""

    def __init__(self, study, url, calibration):
        command = [sys.executable, "-m", "r2sego_blender", "trials", "run", str(study), "--json-progress"]
        command += ["--device", url, "--calibration", str(calibration)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.live = None
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self):
        for line in self.process.stdout:
            if (event := json.loads(line))["event"] == "live":
                self.live = Live.from_json(event)

    def wait(self, state):
        deadline_s = time.monotonic() + 60.0
        while self.live is None or self.live.state is not state:
            assert time.monotonic() < deadline_s, self.live
            time.sleep(0.05)


def test_a_session_that_was_started_elsewhere_is_told_what_its_operator_does(
    blender_environment, declaration, tmp_path
):
    _, study = freeze_plan(declaration)
    simulated_calibration().save(tmp_path / "cells.json")

    def tell(*arguments):
        done = run(blender_environment, study, *arguments)
        assert done.returncode == 0, done.stderr

    device = simulated_device("idle", rate_hz=100)
    with device as url:
        session = Session(study, url, tmp_path / "cells.json")
        try:
            session.wait(State.SET_UP)
            tell("--tell", "ARM")
            session.wait(State.ARMED)
            tell("--tell", "NOTE", "--text", "the chair wobbles")
            tell("--tell", "START")
            session.wait(State.RUNNING)
            device.play("success")
            deadline_s = time.monotonic() + 30.0
            while session.live.support_s < 2.2 and time.monotonic() < deadline_s:
                time.sleep(0.05)
            tell("--tell", "END")
            session.wait(State.JUDGED)
            assert session.live.outcome is Outcome.SUCCESS, session.live
            tell("--judge", "FAILURE", "--by", "A. B.", "--text", "sat on the edge")
            tell("--tell", "STOP")
            assert session.process.wait(30) == 0
        finally:
            session.process.kill()
            session.process.wait()
    (entry,) = RecordIndex(study).entries()
    assert (entry.sensors.outcome, entry.judgement.outcome) == (Outcome.SUCCESS, Outcome.FAILURE)
    assert "A. B." in entry.judgement.manual and "sat on the edge" in entry.judgement.manual
    events = read_record(study / "records" / entry.name).events
    assert "the chair wobbles" in [event.text for event in events]
