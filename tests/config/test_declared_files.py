"""The one reader of declared files: types, ranges, names, and bounds kept before a file is parsed."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from expected_errors import refused

from r2sego_blender.config.declared_files import Reader, did_you_mean, parse_toml
from r2sego_blender.config.fields import Range, fields_of, in_keys, setting
from r2sego_blender.core.errors import RobotError, SceneError


@dataclass(frozen=True)
class Part:
    speed_m_s: Range = setting((0.1, 0.2), "Speed.", 0.0, 2.0)
    count: int = setting(3, "How many.", 1, 9)
    kind: str = setting("one", "Which.", choices=("one", "two"))
    scale: float | tuple[float, ...] = 1.0


@dataclass(frozen=True)
class Whole:
    name: str
    rows: tuple[tuple[str, float], ...] = setting((), form="Write rows [name, angle].")
    parts: tuple[Part, ...] = ()
    part: Part = Part()
    is_kept: bool = True
    height_m: float | None = None


READER = Reader(Path("mine.toml"), "whole", RobotError)


def read(text: str) -> Whole:
    return READER.table(Whole, parse_toml(text))


def test_what_is_given_has_its_type_and_what_is_left_out_its_default():
    whole = read("""
        name = "a"
        rows = [["left", 1], ["right", 0.5]]
        height_m = 2
        part = { speed_m_s = [0, 1], scale = 2 }
        parts = [{ scale = [1, 2] }, {}]
    """)
    assert whole == Whole(
        "a", (("left", 1.0), ("right", 0.5)), (Part(scale=(1.0, 2.0)), Part()), Part((0.0, 1.0), scale=2.0), True, 2.0
    )
    assert isinstance(whole.height_m, float) and isinstance(whole.rows[0][1], float)


@pytest.mark.parametrize(
    ("text", "place", "cure"),
    [
        ("", "name is missing", "text"),
        ("name = 3", "name is 3", "text"),
        ("nmae = 'a'", "nmae is not a field of this whole", "Did you mean name?"),
        ("name = 'a'\nxyz = 1", "xyz is not a field", "Known: name, rows"),
        ("name = 'a'\npart = 3", "part is not a table", "[part]"),
        ("name = 'a'\npart.speed_m_s = 1", "part.speed_m_s is 1", "[low, high]"),
        ("name = 'a'\npart.speed_m_s = [1, 0]", "part.speed_m_s is [1, 0]", "smaller number first"),
        ("name = 'a'\npart.speed_m_s = [1, 3]", "part.speed_m_s is [1, 3]", "from 0 to 2"),
        ("name = 'a'\npart.speed_m_s = [nan, 1]", "part.speed_m_s is [nan, 1]", "finite"),
        ("name = 'a'\npart.count = 1.5", "part.count is 1.5", "whole number"),
        ("name = 'a'\npart.count = true", "part.count is True", "whole number"),
        ("name = 'a'\npart.kind = 'three'", "part.kind is 'three'", "one, two"),
        ("name = 'a'\nparts = [{}, {count = 0}]", "parts[1].count is 0", "from 1 to 9"),
        ("name = 'a'\nrows = [['b', 1], ['c']]", "rows[1] is ['c']", "rows [name, angle]"),
        ("name = 'a'\nrows = 'b'", "rows is 'b'", "rows [name, angle]"),
        ("name = 'a'\nis_kept = 1", "is_kept is 1", "true or false"),
        ("name = 'a'\nheight_m = inf", "height_m is inf", "finite"),
        ("name = 'a'\nheight_m = []", "height_m is []", "finite"),
    ],
)
def test_errors_say_file_field_and_cure(text, place, cure):
    with pytest.raises(RobotError) as caught:
        read(text)
    assert caught.value.where == "mine.toml"
    assert caught.value.what.startswith(place) and cure in caught.value.cure


def test_a_reader_that_is_not_strict_leaves_out_what_it_does_not_know():
    lenient = Reader(Path("scene.toml"), "scene", SceneError, strict=False)
    assert lenient.table(Whole, {"name": "a", "later": 1}) == Whole("a")


def test_the_nearest_name_is_meant():
    assert did_you_mean("part", ["parts", "whole"], "None.") == "Did you mean parts?"
    assert did_you_mean("hwole", ["parts", "whole"], "None.") == "Did you mean whole?"
    assert did_you_mean("zzz", ["parts", "whole"], "None.") == "None."


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = " + "[" * 33 + "]" * 33, "nested"),
        ("a = " + "{b=" * 40 + "1" + "}" * 40, "nested"),
        (".".join("a" * 40) + " = 1", "nested"),
        ("[" + ".".join("a" * 60000) + "]", "nested"),
        ("a = " + "1" * 5000, "more than 1000 characters"),
        ("b" * 1001 + " = 1", "more than 1000 characters"),
        ("a = '" + "b" * (1 << 20) + "'", "more than 1048576 characters"),
        ("[[parts]]\n[[parts]]\ncount = 1" + "0" * 400, r"parts\[1\].count is a whole number of more than 64 bits"),
        ("a = [" + "1," * 60000 + "]", "more than 100000 words"),
        (f"a = {-(2**63)}", "a is a whole number of more than 64 bits"),
        ("a = ", "Invalid value"),
    ],
)
def test_what_would_take_long_to_parse_is_refused_before(text, says):
    began_s = time.process_time()
    with pytest.raises(ValueError, match=says):
        parse_toml(text)
    assert time.process_time() - began_s < 1.0


def test_brackets_and_dots_in_texts_and_comments_nest_nothing():
    brackets, dots = "[" * 100, "." * 100
    text = f'a = "{brackets} \\" {dots}"\nb = \'{brackets}\' # {brackets}\nc = """\n{brackets}\n"{dots}"""\n'
    assert parse_toml(text)["b"] == brackets
    numbers = ", ".join(["1.5"] * 1000)
    assert len(parse_toml(f"a = [{numbers}]\nb.c.d = [[[1]]]")["a"]) == 1000


def test_a_file_without_end_is_read_to_its_bound(tmp_path):
    (tmp_path / "a.toml").write_text("a = 1\n" * 200000)
    with refused(RobotError, "a.toml", "at most 1048576"):
        Reader(tmp_path / "a.toml", "whole", RobotError).tables("See.")


def test_keys_hold_former_names_and_what_was_added_only_where_it_was_set():
    @dataclass(frozen=True)
    class Changed:
        present: int = setting(1, formerly="past")
        speed: int = setting(2, changes_result=False)
        new: Any = setting(3, added=True)

    assert in_keys(Changed(5, 6, 3)) == {"past": 5}
    assert in_keys(Changed(new=4)) == {"past": 1, "new": 4}
    assert [field.default for field in fields_of(Whole).values()][2:] == [(), Part(), True, None]
