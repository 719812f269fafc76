"""Names that a stranger gave: a terminal that shows them is not controlled by them."""

from __future__ import annotations

import io
import json

import click
import pytest
from click.testing import CliRunner

from r2sego_blender.commands.options import Output, output_options
from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.progress import TerminalProgress

NAME = "chair\x1b]0;owned\x07\x1b[2J\r\x9b31m\u202e\ud800"


def shown(line: str) -> bool:
    return not [one for one in line if ord(one) < 32 or 127 <= ord(one) < 160 or one in "\u202e\ud800"]


@pytest.mark.parametrize("how", ["show", "tell"])
def test_a_result_shows_names_as_text(how):
    @click.command
    @output_options("--json")
    def run(output: Output) -> None:
        if how == "show":
            output.show([NAME, "next"], lambda names: names)
        else:
            output.tell(objects={NAME: 3}, second=NAME)

    told = CliRunner().invoke(run, [], obj={}).output
    assert told.count("\n") == 2
    assert all(map(shown, told.splitlines()))
    if how == "show":
        assert json.loads(CliRunner().invoke(run, ["--json"], obj={}).output)[0] == NAME


def test_a_message_and_an_error_are_lines_of_text(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    TerminalProgress().message(NAME, "warning")
    assert stream.getvalue().count("\n") == 1
    assert shown(stream.getvalue().rstrip("\n"))
    error = SceneError(f"'{NAME}' " + "is not there; " * 50_000, where=NAME, cure=NAME)
    assert shown(str(error))
    assert len(str(error)) < 2500


def test_a_bar_is_called_as_the_file_is(monkeypatch):
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    with TerminalProgress().task("chair[/b]\x1b]0;owned\x07", 1) as task:
        task.advance()
    assert "chair[/b]\\x1b]0;owned" in screen.getvalue()
    assert "\x07" not in screen.getvalue()
