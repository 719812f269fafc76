"""``r2sego trials run``, ``judge`` and ``records``: at a real terminal, for Blender, and for whoever reads records."""

import json
import os
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner
from trials.declarations import declared

from r2sego_blender.commands.cli import main
from r2sego_blender.trials.line.simulated import simulated_calibration, simulated_device
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.study import freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.running.controls import Control, send
from r2sego_blender.trials.running.live import LIVE_EVENT, Live, State
from r2sego_blender.workers.engine import engine_environment

PATIENT = "support_s = 2.0\nmax_silence_ms = 5000.0\nmax_drift = 0.1"  # a busy machine may read late
TERMINALS = pytest.mark.skipif(sys.platform == "win32", reason="no terminals of Unix")


def r2sego(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A study whose simulated trials were all run."""
    folder = tmp_path_factory.mktemp("recorded")
    _, study = freeze_plan(declared(folder, "trials = 1"))
    said = r2sego("trials", "run", study, "--simulated")
    assert said.exit_code == 0, said.output
    return study


def test_a_plan_is_tried_without_hardware(recorded):
    entries = RecordIndex(recorded).entries()
    usable = [entry for entry in entries if entry.judgement.outcome is not Outcome.UNUSABLE]
    assert len(usable) == 6 and all(entry.simulated for entry in entries)


def test_records_are_listed_and_judged_again(recorded):
    rows = json.loads(r2sego("trials", "records", recorded, "--json").output)
    assert [row["state"] for row in rows] == ["whole"] * len(rows)
    for row in rows:
        again = json.loads(r2sego("trials", "judge", recorded / "records" / row["file"], "--json").output)
        assert {name: again[name] for name in again if name != "record"} == {
            name: row[name] for name in again if name != "record"
        }


def test_a_judgement_by_hand_is_added_and_a_changed_file_is_seen(recorded):
    entry = next(one for one in RecordIndex(recorded).entries() if one.judgement.outcome is Outcome.SUCCESS)
    file = recorded / "records" / entry.name
    said = r2sego("trials", "judge", file, "--as", "failure", "--by", "A. Person", "--because", "slid off")
    assert said.exit_code == 0, said.output
    found = next(one for one in RecordIndex(recorded).entries() if one.number == entry.number)
    assert found.judgement.outcome is Outcome.FAILURE and found.sensors == entry.sensors
    assert r2sego("trials", "judge", file, "--as", "failure").exit_code == 1  # nobody's
    assert r2sego("trials", "judge", file, "--by", "A. Person", "--because", "slid off").exit_code == 1  # as nothing
    whole = file.read_bytes()
    try:
        file.write_bytes(whole[:-9])
        rows = json.loads(r2sego("trials", "records", recorded, "--json").output)
        assert [row["record"] for row in rows if row["state"] == "changed"] == [entry.number]
        file.unlink()
        rows = json.loads(r2sego("trials", "records", recorded, "--json").output)
        assert [row["record"] for row in rows if row["state"] == "missing"] == [entry.number]
    finally:
        file.write_bytes(whole)


def test_a_device_and_its_calibration_have_to_be_given(recorded):
    assert r2sego("trials", "run", recorded).exit_code == 1
    assert r2sego("trials", "run", recorded / "none", "--simulated").exit_code == 1


def command(study, url, *options):
    calibration = study.parent / "calibration.json"
    simulated_calibration().save(calibration)
    run = [sys.executable, "-m", "r2sego_blender", "trials", "run", study, "--device", url]
    return [*map(str, run), "--calibration", str(calibration), *options]


@TERMINALS
@pytest.mark.slow
def test_blender_follows_and_tells_a_session(tmp_path):
    _, study = freeze_plan(declared(tmp_path, "trials = 1", PATIENT))
    device, seen = simulated_device("idle"), []
    with device as url:
        process = subprocess.Popen(
            command(study, url, "--json-progress"), stdout=subprocess.PIPE, text=True, env=engine_environment()
        )
        for line in process.stdout:
            event = json.loads(line)
            if event["event"] != LIVE_EVENT:
                break
            live = Live.from_json(event)
            is_new = not seen or seen[-1].state is not live.state
            seen.append(live)
            if live.state is State.SET_UP and is_new:
                send(study, Control.ARM)
            elif live.state is State.ARMED and is_new:
                device.play("success")
                send(study, Control.START)
            elif live.state is State.RUNNING and live.support_s > 2.2:
                send(study, Control.END)
            elif live.state is State.JUDGED and is_new:
                send(study, Control.STOP)
        assert process.wait(30) == 0
    assert event == {"event": "result", "records": 1, "success": 1, "failure": 0, "unusable": 0}
    assert seen[-1].state is State.FINISHED and seen[-1].outcome is Outcome.SUCCESS
    running = [live for live in seen if live.state is State.RUNNING]
    assert len(running) / running[-1].elapsed_s == pytest.approx(10.0, rel=0.3)  # ten times a second


@TERMINALS
@pytest.mark.slow
def test_a_trial_is_run_by_keys_at_a_terminal_which_is_left_as_it_was(tmp_path):
    import pty
    import termios

    _, study = freeze_plan(declared(tmp_path, "trials = 1", PATIENT))
    device = simulated_device("idle")
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    with device as url:
        process = subprocess.Popen(
            command(study, url, "--bell"), stdin=theirs, stdout=theirs, stderr=theirs, env=engine_environment()
        )
        shown = Shown(ours)
        shown.wait_for(b"SET UP", b"[a]")
        os.write(ours, b"a")
        shown.wait_for(b"ARMED")
        device.play("tether")
        os.write(ours, b"s")
        shown.wait_for(b"RUNNING")
        os.write(ours, b"mthe left foot slid\r")
        time.sleep(3.0)
        os.write(ours, b"e")
        shown.wait_for(b"JUDGED", b"F  A  I  L  U  R  E", b"\a\a")
        os.write(ours, b"\x03")
        assert process.wait(30) == 0
    after = termios.tcgetattr(theirs)
    assert after == before
    (entry,) = RecordIndex(study).entries()
    assert entry.judgement.outcome is Outcome.FAILURE
    assert b"the left foot slid" in (study / "records" / entry.name).read_bytes()


class Shown:
    """What a terminal shows."""

    def __init__(self, end):
        os.set_blocking(end, False)
        self._end, self._text = end, b""

    def wait_for(self, *words, limit_s=60.0):
        until_s = time.monotonic() + limit_s
        self._text = self._text[-20:]
        while not all(word in self._text for word in words):
            assert time.monotonic() < until_s, self._text[-3000:].decode(errors="replace")
            try:
                self._text += os.read(self._end, 65536)
            except BlockingIOError:
                time.sleep(0.02)
