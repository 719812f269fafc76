"""Settings kept under a name come back as they were."""

import pytest
from expected_errors import refused

from r2sego_blender.config.kept_settings import keep_settings, kept_settings, read_settings, remove_settings
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.results.panels.scene_choices import robot_choices, scope_choices, what_refine_does
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.scope.scope import shipped_scopes


def test_they_come_back(tmp_path):
    changed = {"training.steps_per_round": 500, "proxy.voxel_m": 0.03, "generation.renderer": "cycles"}
    keep_settings(tmp_path, "My room 2", "preview", changed)
    keep_settings(tmp_path, "b", "paper", {})
    assert kept_settings(tmp_path) == ["My room 2", "b"]
    assert read_settings(tmp_path, "My room 2") == ("preview", changed)
    assert read_settings(tmp_path, "b") == ("paper", {})


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden"])
def test_a_name_is_a_plain_one(tmp_path, name):
    with pytest.raises(SettingsError, match="no name"):
        keep_settings(tmp_path, name, "paper", {})


def test_unknown_settings_are_neither_kept_nor_taken(tmp_path):
    with pytest.raises(SettingsError, match="no setting 'x'"):
        keep_settings(tmp_path, "a", "paper", {"x": 1})
    (tmp_path / "a.toml").write_text('preset = "paper"\n[overrides]\nx = 1\n')
    with pytest.raises(SettingsError, match="no setting 'x'"):
        read_settings(tmp_path, "a")
    (tmp_path / "a.toml").write_text('preset = "none"\n')
    with refused(SettingsError, "settings", "'none'"):
        read_settings(tmp_path, "a")


@pytest.mark.parametrize(
    "text", ["", "preset =", "overrides = 3\npreset = 'paper'", "overrides = [[1, 2]]\npreset = 'paper'"]
)
def test_damaged_files_are_named(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    with refused(SettingsError, "a.toml"):
        read_settings(tmp_path, "a")


def test_the_choices_of_a_new_scene_are_there():
    assert tuple(scope_choices()) == shipped_scopes()
    for robot in robot_choices():
        assert RobotModel.load(robot).model.nq > 0


def test_refine_says_what_it_does_next():
    assert what_refine_does(0, 0, 3) == "Refine does round 0 (3 in all)"
    assert what_refine_does(2, 1, 3) == "Refine goes on in round 1 (3 in all)"
    assert what_refine_does(3, 3, 3) == "Refine redoes what changed"


def test_removed_settings_are_gone_and_others_cannot_be_removed(tmp_path):
    keep_settings(tmp_path, "quick", "preview", {})
    remove_settings(tmp_path, "quick")
    assert kept_settings(tmp_path) == []
    for name in ("quick", ""):
        with refused(SettingsError, f"{name}.toml", "removed"):
            remove_settings(tmp_path, name)
