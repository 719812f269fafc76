"""Text is written and read alike by every system: UTF-8, and lines that end in a line feed."""

import ast
import os
from pathlib import Path

import pytest

from r2sego_blender.core.text_files import read_text, write_text

LIBRARY = Path(__file__).parents[2] / "r2sego_blender"
WRITERS = {"text_files.py"}
"""Who ends lines by hand; the program has no library beside it."""
ONLY_LINUX = {"confinement.py", "processes.py", "resources.py"}
"""They ask /proc."""


def test_a_file_has_the_bytes_of_its_text_in_utf_8(tmp_path):
    write_text(tmp_path / "a.txt", "Größe\n部屋\n")
    assert (tmp_path / "a.txt").read_bytes() == "Größe\n部屋\n".encode()


def test_a_pipe_is_refused_at_once_and_a_large_file_before_it_is_read(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"x" * 100)
    assert read_text(tmp_path / "a.txt", 100) == "x" * 100
    with pytest.raises(ValueError, match="100 bytes"):
        read_text(tmp_path / "a.txt", 99)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(ValueError, match="pipe"):
            read_text(tmp_path / "pipe", 100)


def _calls():
    for file in sorted(LIBRARY.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                yield file, node, {word.arg for word in node.keywords}


def test_no_file_leaves_its_letters_or_line_ends_to_the_system():
    wrong = []
    for file, node, words in _calls():
        name = node.func.attr
        modes = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        of_click = ast.unparse(node.func.value) == "formatter"  # a page of help, no file
        writes = name == "write_text" and not of_click and file.name not in WRITERS | ONLY_LINUX
        reads = name == "read_text" and "encoding" not in words and file.name not in ONLY_LINUX
        opens = name == "open" and set(modes) & {"r", "w", "x"} and not {"encoding", "newline"} <= words
        if writes or reads or opens:
            wrong.append(f"{file.relative_to(LIBRARY).as_posix()}:{node.lineno}")
    assert wrong == []
