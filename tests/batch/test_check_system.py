"""A missing system library is named together with the one line that cures it."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).parents[2] / "batch" / "check_system.py"
_spec = importlib.util.spec_from_file_location("check_system", PATH)
check_system = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(check_system)


def load_all_but(*absent: str):
    def load(library: str) -> None:
        if library in absent:
            raise OSError(library)

    return load


def test_nothing_is_missing_where_all_load():
    assert check_system.missing_libraries(load_all_but()) == []


@pytest.mark.parametrize(
    ("program", "line"),
    [
        ("apt-get", ("apt-get install -y", ["libxi6", "libgl1"])),
        ("dnf", ("dnf install -y", ["libXi", "mesa-libGL"])),
        ("pacman", ("pacman -S --noconfirm", ["libxi", "libglvnd"])),
    ],
)
def test_the_cure_is_in_the_words_of_the_machines_package_manager(program, line):
    missing = check_system.missing_libraries(load_all_but("libXi.so.6", "libGL.so.1"))
    assert missing == ["libXi.so.6", "libGL.so.1"]
    assert check_system.cure(missing, which=lambda name: name == program) == line


def test_main_prints_the_line_and_fails(monkeypatch, capsys):
    monkeypatch.setattr(check_system, "missing_libraries", lambda: ["libSM.so.6"])
    assert check_system.main([]) == 1
    error = capsys.readouterr().err
    assert "libSM.so.6" in error and "install" in error
