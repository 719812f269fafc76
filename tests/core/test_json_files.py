"""JSON of anywhere: what a reader may take for granted of it."""

import json
import math
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.json_files import finite_number, opened_json, parse_json, read_json, write_json

NUMBERS = st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS, lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner)
)


@given(VALUES)
def test_what_is_json_and_finite_is_read_as_by_the_standard_library(value):
    assert parse_json(json.dumps(value)) == value


def test_what_is_written_is_read_back(tmp_path):
    write_json(tmp_path / "a.json", {"rounds": [1, 2]})
    assert (tmp_path / "a.json").read_bytes() == b'{\n "rounds": [\n  1,\n  2\n ]\n}\n'
    assert read_json(tmp_path / "a.json") == {"rounds": [1, 2]}
    (tmp_path / "marked.json").write_bytes(b"\xef\xbb\xbf[1]")  # as some programs on Windows begin
    assert read_json(tmp_path / "marked.json") == [1]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "NaN",
        "[-Infinity]",
        '{"a": 1e999}',
        "[" * 200_000,
        "[" * 40 + "]" * 40,
        '{"a":' * 500 + "1" + "}" * 500,
        "9" * 5000,
        str(2**63),
        str(-(2**80)),
        '"\\ud800"',
        '{"\\udfff": 1}',
        "[" + "[]," * 1_100_000 + "[]]",
    ],
)
def test_what_breaks_readers_is_refused(text):
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


def test_a_matrix_may_be_as_deep_as_files_have_them():
    assert parse_json("[" * 32 + "1.5" + "]" * 32)
    assert math.isclose(parse_json('{"a": {"b": [[1e300]]}}')["a"]["b"][0][0], 1e300)


@pytest.mark.parametrize("text", ["", "[]", "3", '{"others": 1}', '{"rounds": NaN}', "\udcff"])
def test_a_damaged_file_is_named_with_its_cure(tmp_path, text):
    (tmp_path / "a.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with (
        pytest.raises(SceneError, match=r"a\.json: it is damaged\. Run `r2sego refine` again\."),
        opened_json(tmp_path / "a.json", SceneError, "it is damaged") as read,
    ):
        assert read["rounds"]


def test_a_file_that_may_not_be_read_is_not_called_damaged(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", refused)
    with (
        pytest.raises(SceneError, match=r"a\.json: it may not be read\. Allow"),
        opened_json(tmp_path / "a.json", SceneError, "it is damaged"),
    ):
        pass


@pytest.mark.parametrize("value", ["nan", float("inf"), "-Infinity", "x"])
def test_a_text_of_no_number_is_none(value):
    with pytest.raises(ValueError, match=r"."):
        finite_number(value)
    assert finite_number(3) == 3.0
