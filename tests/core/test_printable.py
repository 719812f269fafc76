"""What others wrote, shown: it moves no cursor and fills no screen."""

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.printable import printable


@given(st.text(st.characters()))
def test_no_text_controls_what_shows_it(text):
    shown = printable(text)
    assert not [one for one in shown if unicodedata.category(one) in ("Cc", "Cs", "Zl", "Zp") or one in "\u202e\u2066"]
    shown.encode("utf-8")


@given(st.text(st.characters(categories=["L", "N", "P", "Zs"])))
def test_names_of_any_language_are_shown_as_they_are(text):
    assert printable(text) == text


def test_a_long_text_keeps_its_ends():
    assert len(printable("\0" * 300_000, 100)) <= 100
    shown = printable("begin" + "x" * 300_000 + "end", 100)
    assert len(shown) <= 100
    assert shown.startswith("begin")
    assert shown.endswith("end")
