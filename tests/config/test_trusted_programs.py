"""Programs are trusted by their content, on this machine, until that is withdrawn."""

import json

import pytest

from r2sego_blender.config.trusted_programs import Program, is_trusted, trust, trusted_programs, withdraw
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.user_configuration import CONFIGURATION_VARIABLE


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(CONFIGURATION_VARIABLE, str(tmp_path / "not there yet"))
    return tmp_path / "not there yet"


def test_content_is_trusted_whatever_its_name_until_it_is_withdrawn():
    program = Program.of("walk.pt", b"a program")
    assert not is_trusted(program)
    trust(program)
    trust(program)
    assert trusted_programs() == (program,)
    assert is_trusted(Program.of("renamed.pt", b"a program"))
    assert not is_trusted(Program.of("walk.pt", b"another program"))
    assert withdraw(program.sha256) == program
    assert not is_trusted(program)
    with pytest.raises(SettingsError):
        withdraw(program.sha256)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"programs": 1}',
        '{"programs": [{}]}',
        '{"programs": [{"name": "a", "size": 1, "sha256": "*"}]}',
        '{"programs": [{"name": "a", "size": "x", "sha256": "' + 64 * "0" + '"}]}',
        "[" * 100_000,
    ],
)
def test_a_damaged_list_trusts_nothing_and_names_itself(folder, text):
    folder.mkdir()
    (folder / "trusted_programs.json").write_text(text)
    with pytest.raises(SettingsError, match=r"trusted_programs\.json"):
        is_trusted(Program.of("walk.pt", b""))


def test_the_list_is_what_people_can_read(folder):
    program = Program.of("walk.pt", bytes(1_234_567))
    trust(program)
    (record,) = json.loads((folder / "trusted_programs.json").read_text())["programs"]
    assert record == {"name": "walk.pt", "size": 1_234_567, "sha256": program.sha256}
    assert str(program) == f"walk.pt, sha256 {program.sha256}, 1.2 MB"
