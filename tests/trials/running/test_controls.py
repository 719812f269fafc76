"""Controls reach the session once, in their order, whatever else lies in the file."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.running.controls import CONTROLS_FILE, MOST_BYTES, Control, Controls, send

CONTROLS = st.lists(st.tuples(st.sampled_from(Control), st.text(max_size=200)), max_size=20)


@given(CONTROLS, st.lists(st.integers(0, 20), max_size=5))
def test_each_is_read_once_and_in_order(tmp_path_factory, sent, pauses):
    folder = tmp_path_factory.mktemp("study")
    controls, found = Controls(folder), []
    for index, (control, text) in enumerate(sent):
        if index in pauses:
            found += controls.read()
        send(folder, control, text=text)
    found += controls.read()
    assert [(told.control, told.text()) for told in found] == sent
    assert controls.read() == []


def test_what_was_told_before_a_session_is_not_for_it(tmp_path):
    send(tmp_path, Control.START)
    controls = Controls(tmp_path)
    send(tmp_path, Control.STOP)
    assert [told.control for told in controls.read()] == [Control.STOP]


@given(st.lists(st.one_of(st.just(b'{"control": "arm"}'), st.binary(max_size=50), st.just(b"[" * 9000))))
def test_lines_that_are_no_controls_pass(tmp_path_factory, lines):
    folder = tmp_path_factory.mktemp("study")
    controls = Controls(folder)
    (folder / CONTROLS_FILE).write_bytes(b"".join(line + b"\n" for line in lines))
    found = [told for _ in range(len(lines) // 5 + 2) for told in controls.read()]
    assert sum(told.control is Control.ARM for told in found) == lines.count(b'{"control": "arm"}')


def test_a_half_written_line_waits_for_its_end(tmp_path):
    controls = Controls(tmp_path)
    with (tmp_path / CONTROLS_FILE).open("wb", buffering=0) as file:
        file.write(b'{"control": "no')
        assert controls.read() == []
        file.write(b'te", "text": "a"}\n')
        assert [(told.control, told.text()) for told in controls.read()] == [(Control.NOTE, "a")]


def test_endless_lines_and_emptied_files_do_not_stop_it(tmp_path):
    controls = Controls(tmp_path)
    (tmp_path / CONTROLS_FILE).write_bytes(b"x" * 200_000 + b"\n")
    send(tmp_path, Control.ARM)
    found = [told.control for _ in range(5) for told in controls.read()]
    assert found == [Control.ARM]
    (tmp_path / CONTROLS_FILE).write_bytes(b"")
    controls.read()
    send(tmp_path, Control.END)
    assert [told.control for told in controls.read()] == [Control.END]


def test_a_control_that_is_too_long_is_refused(tmp_path):
    with pytest.raises(TrialError):
        send(tmp_path, Control.NOTE, text="x" * MOST_BYTES)
    assert not (tmp_path / CONTROLS_FILE).exists()


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW") or not hasattr(os, "mkfifo"), reason="links and pipes of Unix")
def test_a_strangers_link_or_pipe_is_neither_written_nor_read(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text('{"control": "arm"}\n')
    study = tmp_path / "study"
    study.mkdir()
    (study / CONTROLS_FILE).symlink_to(elsewhere)
    with pytest.raises(TrialError):
        send(study, Control.START)
    assert elsewhere.read_text() == '{"control": "arm"}\n'
    (study / CONTROLS_FILE).unlink()
    os.mkfifo(study / CONTROLS_FILE)
    with pytest.raises(TrialError):
        send(study, Control.START)
    assert Controls(study).read() == []
