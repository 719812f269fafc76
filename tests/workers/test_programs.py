"""A bundle that somebody stands in brings no program by the name of another."""

import os

import pytest
from stand_in_program import write_program

from r2sego_blender.workers.programs import find_program, words_of


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """The folder one stands in, and one in ``PATH``; both have a program ``tool``."""
    for name in ("bundle", "programs"):
        (tmp_path / name).mkdir()
        write_program(tmp_path / name / "tool", "")
    monkeypatch.chdir(tmp_path / "bundle")
    return tmp_path / "bundle", tmp_path / "programs"


@pytest.mark.parametrize("first", [".", ""])
def test_a_name_is_looked_for_in_whole_paths_alone(folders, monkeypatch, first):
    monkeypatch.setenv("PATH", first)
    assert find_program("tool") is None
    monkeypatch.setenv("PATH", str(folders[1]))
    found = find_program("tool")
    assert found is None if os.name == "nt" else found == str(folders[1] / "tool")


def test_a_path_is_taken_as_it_stands(folders):
    program = next(folders[0].glob("tool*"))
    assert find_program(str(program)) == str(program)
    assert find_program(f".{os.sep}{program.name}") is not None
    assert find_program(str(folders[0] / "nothing")) is None


def test_a_command_is_read_as_its_system_writes_it():
    told = r'"C:\Program Files\Python\python.exe" C:\gen\run.py --fast'
    assert words_of(told, "nt") == [r"C:\Program Files\Python\python.exe", r"C:\gen\run.py", "--fast"]
    assert words_of(r"'/opt/my gen/run' a\ b", "posix") == ["/opt/my gen/run", "a b"]
