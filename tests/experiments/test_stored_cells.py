"""Experiments over storage: machines that share no disk come to the same tables, and nothing is done twice."""

from __future__ import annotations

import dataclasses
import functools
import shutil

import pytest
from click.testing import CliRunner
from fake_experiment import PROGRAM, finished, pictures
from progress_recorder import ProgressRecorder

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.experiments.experiment import Experiment, run_experiment
from r2sego_blender.experiments.gathering import LATEX, MARKDOWN
from r2sego_blender.experiments.plan import Plan
from r2sego_blender.experiments.ray_runner import __version__, do_on_node
from r2sego_blender.experiments.running import run_cell
from r2sego_blender.experiments.stored_cells import StoredCells, _relative, put_scenes

RUN = functools.partial(run_cell, program=PROGRAM)


@pytest.fixture
def plan(plan_file, tmp_path):
    """The plan with its held-out views in the scene's own folder."""
    shutil.move(tmp_path / "held_out", tmp_path / "room/held_out")
    plan_file.write_text(plan_file.read_text().replace('"held_out"', '"room/held_out"'))
    return Plan.load(plan_file)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Makes this process one of another machine, with a disk of its own."""

    def be(name):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / name))
        return tmp_path / name

    be("first")
    return be


def cell_of(plan, tmp_path):
    return Experiment.of(plan, tmp_path / "out", write=False).cells[0]


@pytest.mark.parametrize("kind", ["store", "s3"])
def test_tables_are_those_of_one_disk_and_nothing_is_done_twice(kind, request, plan, control, machine, tmp_path):
    store = request.getfixturevalue(kind)
    run_experiment(plan, tmp_path / "here", 1, program=PROGRAM)
    before = len(finished(control, "evaluate"))
    found, failures = run_experiment(plan, tmp_path / "out", 2, program=PROGRAM, store=store)
    assert not failures and len(found.records) == 4 and len(finished(control, "evaluate")) == before + 4
    for name in (MARKDOWN, LATEX):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    for cell in found.cells:
        assert (cell.folder / "record.json").is_file() and not (cell.bundle / "asset.ply").exists()
        assert cell.imported.is_dir()
        assert store.fetch(_relative(cell, cell.folder), tmp_path / "whole")
        assert (tmp_path / "whole/bundle.r2s/asset.ply").is_file()
    assert len(finished(control, "new")) == 4  # two here, two there
    # Another driver, on another machine, with an empty folder: all is there.
    machine("second")
    again, failures = run_experiment(plan, tmp_path / "elsewhere", 2, program=PROGRAM, store=store)
    assert not failures and not again.left and len(finished(control, "evaluate")) == before + 4
    assert (tmp_path / "elsewhere" / MARKDOWN).read_bytes() == (tmp_path / "out" / MARKDOWN).read_bytes()


def test_a_cell_goes_on_elsewhere_from_what_was_stored(plan, store, control, machine, tmp_path):
    cell = cell_of(plan, tmp_path)
    put_scenes([cell], store)
    (control / "abort").write_text("1")
    assert StoredCells(store, RUN)(cell).record is None
    assert store.has(_relative(cell, cell.imported))
    other = machine("second")
    outcome = StoredCells(store, RUN)(cell)
    assert outcome.record is not None and outcome.record.key == cell.key
    assert len(finished(control, "new")) == 1  # the import came from storage
    assert not (tmp_path / "out/cells").exists()
    (bundle,) = other.glob("r2sego/experiments/*/*/cells/paper/room/*/seed_0/bundle.r2s")
    assert (bundle / "asset.ply").read_text() != "half"


def test_a_node_needs_no_disk_of_others_where_there_is_storage(plan, store, control, machine, tmp_path):
    cell = cell_of(plan, tmp_path)
    put_scenes([cell], store)
    assert do_on_node(RUN, cell, __version__).record is None
    assert do_on_node(StoredCells(store, RUN), cell, __version__).record is not None


def test_storage_that_is_gone_is_a_failure_of_the_cell_and_of_nothing_else(plan, store, control, machine, tmp_path):
    cell = cell_of(plan, tmp_path)
    put_scenes([cell], store)
    shutil.rmtree(tmp_path / "storage")
    (tmp_path / "storage").write_text("no folder")
    outcome = StoredCells(store, RUN)(cell)
    assert outcome.record is None and outcome.failure and not finished(control, "evaluate")


def test_tables_are_made_though_a_cell_cannot_be_brought(plan, store, control, machine, tmp_path, monkeypatch):
    def fails(cell, store):
        raise ExperimentError("the network is gone", where="storage")

    monkeypatch.setattr("r2sego_blender.experiments.experiment.bring", fails)
    recorder = ProgressRecorder()
    found, failures = run_experiment(plan, tmp_path / "out", 1, recorder, program=PROGRAM, store=store)
    assert not failures and len(found.records) == 4 and "Incomplete" not in (tmp_path / "out" / MARKDOWN).read_text()
    assert sum("the network is gone" in warning for warning in recorder.warnings) == 4


def test_a_scene_of_several_places_cannot_be_stored_and_says_why(plan, store, tmp_path):
    (tmp_path / "my.xml").write_text("<mujoco/>")
    scene = plan.scenes[0]
    cell = cell_of(plan, tmp_path)
    for changed in (
        dataclasses.replace(scene, frozen=tmp_path / "elsewhere"),
        dataclasses.replace(scene, poses=tmp_path / "cameras.json"),
        dataclasses.replace(scene, robot=str(tmp_path / "my.xml")),
    ):
        with pytest.raises(ExperimentError, match="room"):
            put_scenes([dataclasses.replace(cell, scene=changed)], store)
    assert not (tmp_path / "storage").exists()


def test_other_photographs_of_the_same_names_are_other_scenes(plan, store, control, machine, tmp_path):
    first, _ = run_experiment(plan, tmp_path / "one", 1, program=PROGRAM, store=store)
    done, imported = len(finished(control, "evaluate")), len(finished(control, "new"))
    pictures(tmp_path / "other", 6, 10)
    for index in range(6):
        shutil.copy(tmp_path / f"other/{10 + index}.png", tmp_path / f"room/{index:02d}.png")
    second, failures = run_experiment(plan, tmp_path / "two", 1, program=PROGRAM, store=store)
    assert not failures and len(finished(control, "evaluate")) == 2 * done
    assert len(finished(control, "new")) == 2 * imported
    keys = [{record.key for record in found.records.values()} for found in (first, second)]
    assert not keys[0] & keys[1]


def test_storage_of_another_kind_is_refused_before_anything_is_made(plan_file, plan, tmp_path):
    asked = ["experiment", str(plan_file), "--out", str(tmp_path / "out"), "--store", "ftp://rooms"]
    result = CliRunner().invoke(main, asked)
    assert result.exit_code != 0 and "s3://" in result.output and not (tmp_path / "out").exists()


def test_an_error_of_any_type_is_a_failure_of_the_cell(plan, store, machine, tmp_path):
    def do(cell):
        raise ValueError("no record")

    cell = cell_of(plan, tmp_path)
    put_scenes([cell], store)
    outcome = StoredCells(store, do)(cell)
    assert outcome.record is None and "ValueError: no record" in outcome.failure


def test_another_version_takes_nothing_of_this_ones(plan, store, control, machine, tmp_path, monkeypatch):
    run_experiment(plan, tmp_path / "one", 1, program=PROGRAM, store=store)
    imported = len(finished(control, "new"))
    for module in ("bundle.keys", "experiments.inputs", "experiments.stored_cells"):
        monkeypatch.setattr(f"r2sego_blender.{module}.__version__", "99.0.0", raising=False)
    _, failures = run_experiment(plan, tmp_path / "two", 1, program=PROGRAM, store=store)
    assert not failures and len(finished(control, "new")) == 2 * imported
