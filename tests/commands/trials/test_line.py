"""The device's commands at a terminal: simulated, calibrated, tested and watched, from its page alone."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from socket_servers import served

from r2sego_blender.commands.trials import trials
from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.calibration.calibration import Calibration
from r2sego_blender.trials.line import self_test
from r2sego_blender.trials.line.framing import hello_line, sample_line
from r2sego_blender.trials.line.simulated import simulated_calibration, simulated_device

ROOT = Path(__file__).parents[3]


def program(*arguments):
    command = [sys.executable, "-m", "r2sego_blender", "trials", *map(str, arguments)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, cwd=ROOT, text=True, **pipes)


def invoke(*arguments):
    return CliRunner().invoke(trials, list(map(str, arguments)), obj={})


@pytest.fixture
def calibration(tmp_path):
    simulated_calibration().save(tmp_path / "cells.json")
    return tmp_path / "cells.json"


def test_a_device_is_calibrated_by_what_the_command_says(tmp_path):
    device = simulated_device("unloaded", 1, 200)
    file = tmp_path / "mine.json"
    with device as url:
        weights = ["--weight", "tether=5", "--weight", "seat=10", "--weight", "seat=20"]
        done = program("calibrate", url, "--to", file, *weights, "--seconds", 0.5, "--json")
        for script in ("unloaded", "weights:5:0", "weights:0:10", "weights:0:20"):
            words = ""
            while not words.endswith("Enter. "):
                letter = done.stderr.read(1)
                assert letter, words
                words += letter
            device.play(script)
            done.stdin.write("\n")
            done.stdin.flush()
        out, err = done.communicate(timeout=60)
    assert done.returncode == 0, err
    channels = json.loads(out)["channels"]
    assert [one["counts_per_newton"] for one in channels] == pytest.approx([812, 640], rel=0.002)
    assert max(abs(residual) for one in channels for residual in one["residuals_n"]) < 0.2
    assert Calibration.load(file).digest == json.loads(out)["sha256"]


def test_a_calibration_without_a_person_is_refused(tmp_path):
    done = invoke("calibrate", "loop://", "--to", tmp_path / "a.json", "--weight", "seat=1")
    assert done.exit_code != 0 and not (tmp_path / "a.json").exists()
    done = invoke("calibrate", "loop://", "--to", tmp_path / "a.json", "--weight", "seat=heavy")
    assert "heavy" in str(done.exception)


@pytest.mark.parametrize("options", [["--to", "nowhere/a.json"], ["--to", "."], ["--to", "a.json", "--seconds", "nan"]])
def test_what_would_come_of_no_calibration_is_told_before_a_weight_is_put_on(options, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = invoke("calibrate", "nothing://", "--weight", "seat=1", *options)
    assert done.exit_code != 0 and "Press" not in done.output and "off all cells" not in done.output
    assert isinstance(done.exception, TrialError | SystemExit)


@pytest.mark.parametrize("seconds", ["nan", "inf", "-1"])
def test_a_device_is_watched_for_a_time(seconds):
    done = invoke("watch", "nothing://", "--seconds", seconds)
    assert isinstance(done.exception, TrialError) and done.exception.where == "--seconds"


def test_a_device_of_another_kind_is_watched_as_such():
    with simulated_device("idle", 1, 200) as url:
        done = invoke("watch", url, "--adapter", "mark10", "--seconds", 1)
    assert done.exit_code == 0 and int(done.output.split()[-1]) > 10


def test_the_self_test_passes_a_device_at_rest_alone(calibration):
    device = simulated_device("idle", 1, 200)
    with device as url:
        passed = invoke("self-test", url, "--calibration", calibration, "--json")
        assert passed.exit_code == 0 and all(one["right"] for one in json.loads(passed.output))
        device.play("weights:0:10")
        failed = invoke("self-test", url, "--calibration", calibration)
        assert failed.exit_code != 0 and "WRONG seat" in failed.output and "WRONG tether" not in failed.output


@contextlib.contextmanager
def sends(data):
    """The URL of a device that sends ``data`` to whoever opens it, and then its last line again and again."""

    def send(reader):
        time.sleep(0.5)  # what comes while a port is opened is thrown away
        reader.sendall(data)
        while True:
            time.sleep(0.05)
            reader.sendall(data[data.rindex(b"$") :])

    with served(send) as port:
        yield f"socket://127.0.0.1:{port}"


CELLS = simulated_calibration().channels
GREETING = hello_line(
    "simulated", "1.0", 1, 100, [(c.channel.name, c.channel.lowest, c.channel.highest) for c in CELLS]
)
SAMPLES = [sample_line(n, 10_000 * n, [round(c.zero) for c in CELLS], 0) for n in range(202)]


def test_the_self_test_counts_damaged_lines_from_the_greeting_on(calibration):
    starting = b"rst:0x1 (POWERON_RESET)\r\nboot:0x8\r\n"
    for between, wrong in ((b"", []), (b"$what a loose wire sends\r\n", ["damaged lines"])):
        with sends(starting + GREETING + between.join(SAMPLES)) as url:
            done = invoke("self-test", url, "--calibration", calibration, "--json")
        assert done.stdout, (done.exception, done.output)
        rows = json.loads(done.stdout)
        assert [one["what"] for one in rows if not one["right"]] == wrong
        assert bool(done.exit_code) == bool(wrong)


def test_the_self_test_of_a_device_whose_clock_stands_still_ends(calibration, monkeypatch):
    monkeypatch.setattr(self_test, "LONGEST_S", 0.5)
    with sends(GREETING + SAMPLES[0]) as url:
        done = invoke("self-test", url, "--calibration", calibration)
    assert isinstance(done.exception, TrialError) and url in str(done.exception)


def test_what_a_device_sends_is_watched(calibration):
    with simulated_device("weights:0:10", 1, 200) as url:
        done = program("watch", url, "--calibration", calibration, "--seconds", 2.5, "--json-progress")
        told = [json.loads(line) for line in done.communicate(timeout=60)[0].splitlines()]
        assert done.returncode == 0 and {round(one["rate_hz"]) for one in told} == {200}
        assert len(told) > 5 and told[-1]["values"]["seat"] == pytest.approx(98.07, abs=0.5)
        assert told[-1]["missing"] == told[-1]["damaged"] == 0
        counts = invoke("watch", url, "--seconds", 1.5)
        assert "simulated" in counts.output and "tether" in counts.output


def test_a_simulated_device_is_run_from_a_terminal(tmp_path):
    file = tmp_path / "cells.json"
    process = program("simulate", "unloaded", "--calibration", file, "--seed", 4)
    try:
        url = process.stdout.readline().strip()
        assert Calibration.load(file).device == "simulated"
        assert invoke("self-test", url, "--calibration", file).exit_code == 0
        process.stdin.write("weights:10:0\n")
        process.stdin.flush()
        process.stderr.readline()
        failed = invoke("self-test", url, "--calibration", file)
        assert "WRONG tether" in failed.output
        process.stdin.write("nonsense\n")
        process.stdin.flush()
        assert "nonsense" in process.stderr.readline()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert not os.path.lexists(url)
    with contextlib.suppress(ProcessLookupError):
        process.kill()


def test_scripts_that_are_not_there_are_named():
    assert "success" in str(invoke("simulate", "walk").exception)


def test_the_sketch_is_written_once_with_its_header(tmp_path):
    assert invoke("sketch", tmp_path).output.strip() == str(tmp_path / "r2sego_trials" / "r2sego_trials.ino")
    assert {file.name for file in (tmp_path / "r2sego_trials").iterdir()} == {"r2sego_trials.ino", "r2sego_line.h"}
    assert invoke("sketch", tmp_path).exit_code != 0
