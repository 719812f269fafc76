"""Which learned backends a machine can use, and why not the others."""

from __future__ import annotations

import json
import sys

import pytest
from click.testing import CliRunner
from stand_in_models import write_stand_ins

from r2sego_blender.commands.cli import main
from r2sego_blender.config.slots import ESTIMATORS
from r2sego_blender.results.backends import examine_backends, lines, why_not
from r2sego_blender.workers import nksr, sam3, sam3d
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS


@pytest.fixture(autouse=True)
def nothing_set_up(monkeypatch, tmp_path):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "nothing"))
    for one in LEARNED_BACKENDS.values():
        monkeypatch.delenv(one.variable, raising=False)


def test_every_learned_estimator_has_its_facts_and_its_label():
    named = {one.name: one.label for one in LEARNED_BACKENDS.values() if one.slot == "depth_estimator"}
    assert named.items() <= ESTIMATORS.labels.items()
    assert all(one.code_licence and one.weights_licence for one in LEARNED_BACKENDS.values())


def test_the_adapters_look_where_the_table_says():
    from r2sego_blender.generation.generators import viewcrafter

    for module, name in ((sam3, "sam3"), (sam3d, "sam3d"), (nksr, "nksr"), (viewcrafter, "viewcrafter")):
        assert LEARNED_BACKENDS[name].variable == module.PYTHON_VARIABLE


def test_nothing_is_usable_where_nothing_is_set_up_and_each_says_what_names_it():
    told = json.loads(CliRunner().invoke(main, ["doctor", "--backends", "--json"]).stdout)["backends"]
    assert [one["name"] for one in told] == list(LEARNED_BACKENDS)
    assert not any(one["usable"] for one in told) and all(one["why"] for one in told)
    text = "\n".join(lines({"backends": told}))
    assert all(one.variable in text for one in LEARNED_BACKENDS.values())


def test_a_backend_is_usable_with_its_interpreter_its_package_and_its_weights(tmp_path, monkeypatch):
    known = LEARNED_BACKENDS["moge-2"]
    monkeypatch.setenv(known.variable, str(tmp_path / "python"))
    assert known.variable in why_not(known)
    monkeypatch.setenv(known.variable, sys.executable)
    assert "moge" in why_not(known)
    environment = write_stand_ins(tmp_path / "environment")
    monkeypatch.setenv("PYTHONPATH", str(environment))
    assert why_not(known) == ""
    assert [one["usable"] for one in examine_backends([known])["backends"]] == [True]
    (environment / "weights.bin").unlink()
    assert "weights" in why_not(known)


def test_an_environment_among_the_settings_is_found_without_a_variable(tmp_path, monkeypatch):
    known = LEARNED_BACKENDS["moge-2"]
    python = known.folder / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    assert known.interpreter() == str(python)
    monkeypatch.setenv(known.variable, sys.executable)
    assert known.interpreter() == sys.executable


def test_what_a_model_needs_beside_its_interpreter_is_named(monkeypatch):
    known = LEARNED_BACKENDS["sam3d"]
    monkeypatch.setenv(known.variable, sys.executable)
    monkeypatch.delenv("R2SEGO_SAM3D_REPOSITORY", raising=False)
    assert why_not(known).startswith("R2SEGO_SAM3D_REPOSITORY")
