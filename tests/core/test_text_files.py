"""Text is written and read alike by every system: UTF-8, and lines that end in a line feed."""

import ast
import json
from pathlib import Path

import pytest

from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.text_files import opened_json, write_json, write_text

LIBRARY = Path(__file__).parents[2] / "r2sego_blender"
WRITERS = {"text_files.py", "viewcrafter_program.py"}
"""Who ends lines by hand; the program has no library beside it."""
ONLY_LINUX = {"resources.py", "processes.py"}
"""They ask /proc."""


def test_a_file_has_the_bytes_of_its_text_in_utf_8(tmp_path):
    write_text(tmp_path / "a.txt", "Größe\n部屋\n")
    assert (tmp_path / "a.txt").read_bytes() == "Größe\n部屋\n".encode()
    write_json(tmp_path / "a.json", {"rounds": [1, 2]})
    assert (tmp_path / "a.json").read_bytes() == b'{\n "rounds": [\n  1,\n  2\n ]\n}\n'
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == {"rounds": [1, 2]}


@pytest.mark.parametrize("text", ["", "[]", "3", '{"others": 1}', "\udcff"])
def test_a_damaged_file_is_named_with_its_cure(tmp_path, text):
    (tmp_path / "a.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with (
        pytest.raises(SceneError, match=r"a\.json: it is damaged\. Run `r2sego refine` again\."),
        opened_json(tmp_path / "a.json", SceneError, "it is damaged") as read,
    ):
        assert read["rounds"]


def test_a_file_that_may_not_be_read_is_not_called_damaged(tmp_path, monkeypatch):
    def refused(path, **_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_text", refused)
    with (
        pytest.raises(SceneError, match=r"a\.json: it may not be read\. Allow"),
        opened_json(tmp_path / "a.json", SceneError, "it is damaged"),
    ):
        pass


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
