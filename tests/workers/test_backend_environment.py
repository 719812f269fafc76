"""An environment for a learned backend: pinned to the letter, made with consent alone, refused without a network."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from progress_recorder import ProgressRecorder

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.backend_environment import INSTALLED, Step, install, steps_of
from r2sego_blender.workers.environment import python_of
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS, Recipe

INSTALLABLE = [one.name for one in LEARNED_BACKENDS.values() if one.recipe]
PINNED = re.compile(r"[A-Za-z0-9_-]+==[0-9][0-9a-z.]*|[A-Za-z0-9-]+ @ git\+https://github\.com/[\w./-]+@[0-9a-f]{40}")


@pytest.mark.parametrize("name", INSTALLABLE)
def test_every_package_is_of_one_version_or_commit(name, tmp_path):
    backend = LEARNED_BACKENDS[name]
    asked = [*backend.recipe.torch, *backend.recipe.packages]
    assert asked and all(PINNED.fullmatch(one) for one in asked), asked
    for step in steps_of(backend, tmp_path):
        if "checkout" in step.command:
            assert re.fullmatch(r"[0-9a-f]{40}", step.command[-1])
    assert backend.name in steps_of(backend, tmp_path)[-1].command


def test_what_is_read_is_what_is_installed():
    """The commit that an adapter says was read is the one that its environment has."""
    library = Path(__file__).parents[2] / "r2sego_blender"
    adapters = {file.stem: file for file in (library / "geometry" / "estimators").glob("*.py")}
    adapters["difix3d"] = library / "evaluation" / "external_arms" / "difix3d_plus.py"
    for name in INSTALLABLE:
        backend = LEARNED_BACKENDS[name]
        told = adapters[backend.worker].read_text()
        pins = [*backend.recipe.packages, *(backend.recipe.clone or ())]
        commits = [found for one in pins for found in re.findall(r"[0-9a-f]{40}", one)]
        assert commits and all(commit in told for commit in commits)


def test_without_consent_everything_is_said_and_nothing_done(tmp_path, monkeypatch):
    def started(*_: object, **__: object) -> None:
        raise AssertionError("a program was started")

    monkeypatch.setattr(subprocess, "Popen", started)
    folder = tmp_path / "environment"
    done = CliRunner().invoke(main, ["backend", "install", "moge-2", "--to", str(folder)])
    assert done.exit_code == 0, done.output
    recipe = LEARNED_BACKENDS["moge-2"].recipe
    assert all(one in done.output for one in (*recipe.torch, *recipe.packages, str(folder)))
    assert LEARNED_BACKENDS["moge-2"].weights_licence in done.output
    assert not folder.exists()


def test_what_cannot_be_installed_is_refused(tmp_path):
    for name in ("sam3", "nothing"):
        done = CliRunner().invoke(main, ["backend", "install", name, "--consent", "--to", str(tmp_path / "a")])
        assert done.exit_code == 1 and done.output.startswith("r2sego: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_without_a_network_it_is_refused_in_a_sentence(tmp_path, monkeypatch):
    for name in [one for one in os.environ if one.startswith("PIP_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/")
    done = CliRunner().invoke(main, ["backend", "install", "moge-2", "--consent", "--to", str(tmp_path / "a")])
    assert done.exit_code == 1
    assert "could not install torch" in done.output and "torch==2.7.1" in done.output


@pytest.mark.slow
def test_what_was_installed_is_written_down(tmp_path, monkeypatch):
    backend = replace(LEARNED_BACKENDS["moge-2"], worker="", recipe=Recipe((), torch=()))
    folder = tmp_path / "made" / "environment"
    steps = steps_of(backend, folder)
    monkeypatch.setattr(
        "r2sego_blender.workers.backend_environment.steps_of",
        lambda *_: [steps[0], Step("look", (str(python_of(folder)), "-c", "import pip"))],
    )
    told = ProgressRecorder()
    python = install(backend, folder, told)
    assert python == python_of(folder) and python.is_file()
    assert (folder / INSTALLED).is_file()
    assert [task.done for task in told.tasks] == [2]


def test_a_step_that_fails_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("r2sego_blender.workers.backend_environment.steps_of", lambda *_: [Step("do this", ("false",))])
    with pytest.raises(MachineError, match="could not do this"):
        install(LEARNED_BACKENDS["moge-2"], tmp_path / "a", ProgressRecorder())
