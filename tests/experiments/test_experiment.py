"""An experiment from its plan to its tables, its cells done by a stand-in: nothing is lost, nothing is done twice."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from fake_experiment import FAKE, PLAN, PROGRAM, finished
from progress_recorder import ProgressRecorder
from stand_in_methods import write_genfusion

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.evaluation.external_arms import genfusion
from r2sego_blender.evaluation.lpips.weights import WEIGHTS_VARIABLE
from r2sego_blender.experiments import scheduling
from r2sego_blender.experiments.experiment import Experiment, alone, run_experiment
from r2sego_blender.experiments.gathering import LATEX, MARKDOWN, METRICS
from r2sego_blender.experiments.plan import Plan
from r2sego_blender.experiments.records import RECORD

needs_signals = pytest.mark.skipif(os.name == "nt", reason="signals are POSIX's")


def scores(folder):
    """What ``metrics.json`` says but for times and memory."""
    measured = ("seconds", "peak_mb", "stages", "steps", "finished")
    entries = json.loads((folder / METRICS).read_text())["cells"]
    return [{key: value for key, value in one.items() if key not in measured} for one in entries]


def test_one_and_two_processes_come_to_the_same_and_nothing_is_done_twice(plan, control, tmp_path, monkeypatch):
    monkeypatch.setattr(scheduling, "_PAUSE", 0.0)  # each cell's end is told, however soon after another's
    one, failures = run_experiment(plan, tmp_path / "one", 1, program=PROGRAM)
    assert not failures and len(one.records) == len(one.cells) == 4
    recorder = ProgressRecorder()
    run_experiment(plan, tmp_path / "two", 2, recorder, program=PROGRAM)
    for name in (MARKDOWN, LATEX, "figures/captures-paper+room.svg"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert scores(tmp_path / "one") == scores(tmp_path / "two") and len(scores(tmp_path / "one")) == 12
    ended = finished(control, "evaluate")
    assert len(ended) == len(set(ended)) == 8
    assert len(finished(control, "new")) == 4  # of two experiments, one for each count
    assert sum("all will be in about" in text and "of 4 cells done" in text for _, text in recorder.messages) == 3

    before = (tmp_path / "one" / MARKDOWN).read_bytes()
    again, failures = run_experiment(plan, tmp_path / "one", 2, program=PROGRAM)
    assert not failures and finished(control, "evaluate") == ended and not again.left
    assert (tmp_path / "one" / MARKDOWN).read_bytes() == before

    table, sha256 = before.decode(), again.cells[0].inputs.frozen_sha256
    assert sha256 in table and sha256 in (tmp_path / "one" / LATEX).read_text()
    entries = json.loads((tmp_path / "one" / METRICS).read_text())["cells"]
    assert {one["frozen_sha256"] for one in entries} == {sha256}
    for entry in entries:
        assert entry["seconds"] > 0.0 and [stage["name"] for stage in entry["stages"]][-2:] == ["refine", "evaluate"]
        assert os.name == "nt" or entry["peak_mb"] > 1.0
        assert [view["name"] for view in entry["views"]] == ["20.png", "21.png"]
    refined = [entry["psnr"] for entry in entries if (entry["arm"], entry["captures"]) == ("refined", 5)]
    assert f"| room | 5 | refined | {sum(refined) / 2:.2f} ± " in table


def test_methods_that_could_not_be_run_are_named_and_cost_no_cell(plan, control, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_NOT_SCORED", "genfusion")
    chosen = dataclasses.replace(plan, arms=("vanilla_3dgs", "difix3d_plus", "genfusion", "refined"), counts=(3,))
    done, failures = run_experiment(chosen, tmp_path / "made", 1, program=PROGRAM)
    assert not failures and len(done.records) == 2
    entries = json.loads((tmp_path / "made" / METRICS).read_text())["cells"]
    assert {one["arm"] for one in entries} == {"vanilla_3dgs", "difix3d_plus", "refined"}
    table = (tmp_path / "made" / MARKDOWN).read_text()
    for told in ("GenFusion was not run in 2 of 2 cells", "not set up", "Difix3D+: difix3d_plus 1.0"):
        assert table.count(told) == 1 and told in (tmp_path / "made" / "page.html").read_text()
    assert not run_experiment(chosen, tmp_path / "made", 1, program=PROGRAM)[0].left


def test_cells_are_scored_again_once_a_method_is_set_up_that_was_not_and_not_for_one_that_broke(
    plan, control, tmp_path, monkeypatch
):
    monkeypatch.setenv("FAKE_NOT_SCORED", "genfusion")
    monkeypatch.delenv(genfusion.BACKEND.variable, raising=False)
    chosen = dataclasses.replace(plan, arms=("vanilla_3dgs", "genfusion", "refined"), counts=(3,))
    run_experiment(chosen, tmp_path / "out", 1, program=PROGRAM)
    monkeypatch.setenv(genfusion.BACKEND.variable, sys.executable)
    monkeypatch.setenv(genfusion.REPOSITORY_VARIABLE, str(write_genfusion(tmp_path / "repository")))
    assert len(Experiment.of(chosen, tmp_path / "out").left) == 2
    done, _ = run_experiment(chosen, tmp_path / "out", 1, program=PROGRAM)  # where it breaks
    assert len(finished(control, "evaluate")) == 4 and all(record.not_scored for record in done.records.values())
    assert not Experiment.of(chosen, tmp_path / "out").left
    monkeypatch.delenv(genfusion.BACKEND.variable)
    assert not Experiment.of(chosen, tmp_path / "out").left


def test_cells_are_scored_again_for_weights_of_lpips_and_not_for_the_lack_of_them(
    two_cells, control, tmp_path, monkeypatch
):
    monkeypatch.delenv(WEIGHTS_VARIABLE, raising=False)
    run_experiment(two_cells, tmp_path / "out", 1, program=PROGRAM)
    weights = tmp_path / "weights"
    weights.mkdir()
    monkeypatch.setenv(WEIGHTS_VARIABLE, str(weights))
    (weights / "alexnet-owt.pth").write_text("one")
    assert not Experiment.of(two_cells, tmp_path / "out").left  # without heads they are none
    (weights / "alex.pth").write_text("heads")
    assert len(Experiment.of(two_cells, tmp_path / "out").left) == 2
    run_experiment(two_cells, tmp_path / "out", 1, program=PROGRAM)
    assert len(finished(control, "evaluate")) == 4 and not Experiment.of(two_cells, tmp_path / "out").left
    (weights / "alexnet-owt.pth").write_text("two")
    assert len(Experiment.of(two_cells, tmp_path / "out").left) == 2
    monkeypatch.delenv(WEIGHTS_VARIABLE)
    assert not Experiment.of(two_cells, tmp_path / "out").left


def test_a_cell_that_aborts_natively_is_tried_again_and_no_more_often_than_that(two_cells, control, tmp_path):
    plan = two_cells
    (control / "abort").write_text("1")
    recorder = ProgressRecorder()
    _, failures = run_experiment(plan, tmp_path / "out", 1, recorder, program=PROGRAM)
    assert not failures and len(finished(control, "evaluate")) == 2
    (warning,) = recorder.warnings
    assert warning.startswith("room, 3 captures, paper, seed 0: ") and warning.endswith("it is tried again")

    (control / "abort").write_text("99")
    found, failures = run_experiment(plan, tmp_path / "other", 1, program=PROGRAM)
    assert set(failures) == {cell.folder for cell in found.cells} and int((control / "abort").read_text()) == 99 - 4
    assert "Incomplete: 2 cells of 2" in (tmp_path / "other" / MARKDOWN).read_text()
    (control / "abort").unlink()
    _, failures = run_experiment(plan, tmp_path / "other", 2, program=PROGRAM)
    assert not failures and (tmp_path / "other" / MARKDOWN).read_bytes() == (tmp_path / "out" / MARKDOWN).read_bytes()


def test_a_cell_is_done_again_only_for_what_it_is_made_of(two_cells, plan_file, control, tmp_path):
    run_experiment(two_cells, tmp_path / "out", 2, program=PROGRAM)
    plan_file.write_text(PLAN.replace("seeds = [0, 1]", "seeds = [0, 2]").replace("[3, 5]", "[5]"))
    found, _ = run_experiment(Plan.load(plan_file), tmp_path / "out", 1, program=PROGRAM)
    assert len(finished(control, "evaluate")) == 3 and finished(control, "evaluate")[-1].endswith(
        str(Path("5", "seed_2", "bundle.r2s"))
    )
    assert {one["seed"] for one in scores(tmp_path / "out")} == {0, 2}
    plan_file.write_text(PLAN.replace('"same_points", ', "").replace("[0, 1]", "[0]"))
    found = Experiment.of(Plan.load(plan_file), tmp_path / "out")
    assert len(found.left) == 2 and {found.state(cell) for cell in found.cells} == {"begun"}


def test_settings_of_an_earlier_plan_do_not_stay_in_a_bundle(plan_file, control, tmp_path):
    text = PLAN.replace("[0, 1]", "[1]").replace("[3, 5]", "[4]")
    with_rounds = (
        text + '\n[[presets]]\npreset = "preview"\noverrides = { rounds = 1, "training.steps_per_round" = 5 }\n'
    )
    plan_file.write_text(with_rounds)
    run_experiment(Plan.load(plan_file), tmp_path / "out", 2, program=PROGRAM)
    plan_file.write_text(text + '\n[[presets]]\npreset = "preview"\n')
    found, _ = run_experiment(Plan.load(plan_file), tmp_path / "out", 2, program=PROGRAM)
    for cell in found.cells:
        declared, captures = json.loads((cell.bundle / "asset.ply").read_text())
        assert declared == {"preset": "preview", "overrides": {"seed": cell.seed}} and len(captures) == cell.captures


@pytest.mark.parametrize("text", [("", "{}"), ('{"key": 1', "[1, 2]")])
def test_a_damaged_record_is_told_and_its_cell_not_done(two_cells, tmp_path, text):
    (tmp_path / "out").mkdir()
    for damaged, cell in zip(text, Experiment.of(two_cells, tmp_path / "out").cells, strict=True):
        cell.folder.mkdir(parents=True)
        (cell.folder / RECORD).write_text(damaged)
    recorder = ProgressRecorder()
    found = Experiment.of(two_cells, tmp_path / "out", recorder)
    assert len(found.left) == 2 and sum(RECORD in text for text in recorder.warnings) == 2


def test_scores_of_other_frozen_views_than_were_fixed_do_not_count(plan_file, control, tmp_path):
    plan_file.write_text(PLAN.replace("[0, 1]", "[0]").replace("[3, 5]", "[3]"))
    (control / "tamper").touch()
    found, failures = run_experiment(Plan.load(plan_file), tmp_path / "out", 1, program=PROGRAM)
    assert "frozen views were changed" in failures[found.cells[0].folder] and not found.records
    (tmp_path / "held_out" / "99.png").unlink()
    (control / "tamper").unlink()
    found, failures = run_experiment(Plan.load(plan_file), tmp_path / "out", 1, program=PROGRAM)
    assert not failures and not found.left


def test_two_runners_of_one_folder_are_refused(plan, control, tmp_path):
    with alone(tmp_path / "out"), pytest.raises(ExperimentError, match="another process runs this experiment"):
        run_experiment(plan, tmp_path / "out", 1, program=PROGRAM)


def test_a_dry_run_says_what_is_done_and_writes_nothing(plan_file, control, tmp_path):
    told = CliRunner().invoke(main, ["experiment", str(plan_file), "--out", str(tmp_path / "out"), "--dry-run"])
    assert told.exit_code == 0 and told.output.count("left   room, ") == 4 and not (tmp_path / "out").exists()
    plan_file.write_text(PLAN.replace("[0, 1]", "[0]").replace("[3, 5]", "[3]"))
    run_experiment(Plan.load(plan_file), tmp_path / "out", 1, program=PROGRAM)
    plan_file.write_text(PLAN)
    asked = ["experiment", str(plan_file), "--out", str(tmp_path / "out"), "--dry-run", "--json"]
    cells = json.loads(CliRunner().invoke(main, asked).output)["cells"]
    assert [cell["state"] for cell in cells] == ["done", "left", "left", "left"]


def test_a_dry_run_refuses_a_storage_that_the_run_would_refuse(plan_file, tmp_path):
    asked = ["experiment", str(plan_file), "--out", str(tmp_path / "out"), "--store", "ftp://host/folder", "--dry-run"]
    told = CliRunner().invoke(main, asked)
    assert told.exit_code != 0 and "ftp://host/folder" in told.output


RUNNER = f"""
import sys
from pathlib import Path
from r2sego_blender.core.progress import TerminalProgress
from r2sego_blender.experiments.experiment import run_experiment
from r2sego_blender.experiments.plan import Plan
from r2sego_blender.workers.cancelling import cancel_at_once
cancel_at_once("finished cells are kept")
program = (sys.executable, "-S", {str(FAKE)!r})
run_experiment(Plan.load(Path(sys.argv[1])), Path(sys.argv[2]), 2, TerminalProgress(), program)
"""


def held_runner(plan_file, control, folder):
    """A runner in a process of its own, both of whose first cells wait in their refinement; with their processes."""
    (control / "held").touch()
    command = [sys.executable, "-c", RUNNER, str(plan_file), str(folder)]
    runner = subprocess.Popen(command, stderr=subprocess.DEVNULL, cwd=Path(__file__).parents[2])
    while len(waiting := list(control.glob("waiting-*"))) < 2:
        assert runner.poll() is None
        time.sleep(0.02)
    return runner, [int(file.name.partition("-")[2]) for file in waiting]


def is_gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


@needs_signals
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="children end with a killed parent on Linux")
def test_a_runner_that_is_ended_leaves_no_process_and_goes_on(number, two_cells, plan_file, control, tmp_path):
    runner, children = held_runner(plan_file, control, tmp_path / "out")
    started_s = time.monotonic()
    runner.send_signal(number)
    runner.wait(timeout=10.0)
    assert time.monotonic() - started_s < 2.0
    while not all(map(is_gone, children)):
        assert time.monotonic() - started_s < 5.0
        time.sleep(0.02)
    assert not finished(control, "evaluate")
    (control / "hold").touch()
    found, failures = run_experiment(two_cells, tmp_path / "out", 2, program=PROGRAM)
    ended = finished(control, "evaluate")
    assert not failures and not found.left and len(ended) == len(set(ended)) == 2
    assert len(finished(control, "new")) == 2  # none of what was finished before
