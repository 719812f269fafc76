"""Where a person's own decisions are kept: outside of every bundle, whoever starts the program where."""

from pathlib import Path

from r2sego_blender.core.user_configuration import CONFIGURATION_VARIABLE, configuration_folder


def test_a_folder_may_be_named(monkeypatch, tmp_path):
    monkeypatch.setenv(CONFIGURATION_VARIABLE, str(tmp_path))
    assert configuration_folder() == tmp_path


def test_the_folder_is_the_system_s_for_what_a_person_decides(monkeypatch, tmp_path):
    monkeypatch.delenv(CONFIGURATION_VARIABLE, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert configuration_folder() == tmp_path / "r2sego"
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setenv("APPDATA", str(tmp_path / "roaming"))
    assert configuration_folder() == tmp_path / "roaming" / "r2sego"


def test_a_relative_folder_is_none_of_the_persons(monkeypatch):
    """The program may be started inside a bundle."""
    monkeypatch.delenv(CONFIGURATION_VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", "configuration")
    assert configuration_folder().is_absolute()
    assert configuration_folder().is_relative_to(Path.home())
