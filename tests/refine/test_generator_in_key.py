"""The generator belongs into the key of the step that makes a round's views, where it is a program."""

import sys
from types import SimpleNamespace

import pytest

from r2sego_blender.config.presets import with_overrides
from r2sego_blender.config.settings import Settings
from r2sego_blender.generation.generators.command import COMMAND_VARIABLE, SIZE_VARIABLE
from r2sego_blender.refine.steps import Steps


@pytest.fixture
def in_key(monkeypatch):
    """What is in the key of a round's views beside settings that were always there."""

    def told(h, command=""):
        monkeypatch.setenv(COMMAND_VARIABLE, command)
        monkeypatch.delenv(SIZE_VARIABLE, raising=False)
        keyed = []
        steps = SimpleNamespace(h=h, _make=lambda *_, settings: keyed.append(settings))
        captures, priors = SimpleNamespace(photographs=0, depth=0), SimpleNamespace(completed=0)
        Steps.ego_video_reg(steps, 0, captures, priors, "proxy", "targets")
        ((*always, fifth),) = (one + [None] * (5 - len(one)) for one in keyed)
        assert always == [h.generation, h.registration, h.selection, h.seed]
        return fifth

    return told


def test_bundles_of_the_embedded_generator_go_on(in_key):
    assert in_key(Settings()) is None


def test_another_program_makes_the_views_anew(in_key, tmp_path):
    by_command, program = with_overrides({"generation.generator": "command"}), tmp_path / "generator.py"
    program.write_text("first")
    command = f"{sys.executable} {program}"
    first = in_key(by_command, command)
    assert first and first == in_key(by_command, command) != in_key(by_command, f"{command} --fast")
    program.write_text("second")
    assert in_key(by_command, command) != first


def test_without_the_program_its_step_can_be_asked_for(in_key):
    """It says that the program is missing only when views have to be made."""
    assert in_key(with_overrides({"generation.generator": "command"})) is None
