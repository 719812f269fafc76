"""Lines are appended whole, behind whatever stands there, and to files alone."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.appended_lines import append_line

LINE = st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\u2028\u2029\x85"), max_size=50)


@given(st.binary(max_size=40), st.lists(LINE, min_size=1, max_size=5))
def test_each_stands_on_a_line_of_its_own_behind_what_was_there(tmp_path_factory, before, lines):
    file = tmp_path_factory.mktemp("lines") / "a.jsonl"
    file.write_bytes(before)
    for line in lines:
        append_line(file, line, to_disk=True)
    cut_off = b"\n" if before and not before.endswith(b"\n") else b""
    assert file.read_bytes() == before + cut_off + b"".join(line.encode() + b"\n" for line in lines)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW") or not hasattr(os, "mkfifo"), reason="links and pipes of Unix")
def test_links_and_pipes_are_refused(tmp_path):
    (tmp_path / "elsewhere").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "pipe"):
        with pytest.raises(OSError):
            append_line(tmp_path / name, "a")
    assert (tmp_path / "elsewhere").read_text() == "kept"
