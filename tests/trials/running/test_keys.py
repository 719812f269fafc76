"""Keys at a terminal become controls."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.trials.running.controls import Control
from r2sego_blender.trials.running.keys import KEYS, Keys


def meant(text):
    return [(told.control, dict(told.data)) for told in Keys().typed(text)]


def test_keys_without_words_act_at_once():
    assert meant("asEin") == [
        (one, {}) for one in (Control.ARM, Control.START, Control.END, Control.INTERVENE, Control.NEXT)
    ]
    assert meant("q") == meant("\x03") == [(Control.STOP, {})]
    assert len({control for control, _ in KEYS.values()}) == len(KEYS) == len(Control)


def test_words_are_told_with_their_control():
    assert meant("mthe cable\x7f\x7fn le\x7f\x7ff\r") == [(Control.NOTE, {"text": "the cabn f"})]
    judged = {"outcome": "failure", "by": "A. Person", "text": "slipped"}
    assert meant("jfailure\rA. Person\nslipped\r") == [(Control.JUDGE, judged)]


def test_what_was_begun_is_taken_back_and_ctrl_c_stops_within_it():
    assert meant("mab\x1bs") == [(Control.START, {})]
    assert meant("mab\x03") == [(Control.STOP, {})]


@pytest.mark.parametrize("special", ["\x1b[A", "\x1bOA", "\x1bOQ", "\x1bOS", "\x1b[1;5S", "\x1b[3~", "\x1b[E"])
def test_arrows_and_function_keys_do_nothing(special):
    """Up ends in the letter that arms, F4 in the one that starts, F2 in the one that stops."""
    assert meant(special) == []
    assert meant(f"mthe {special}cable\r") == [(Control.NOTE, {"text": "the cable"})]


@given(st.text(max_size=200))
def test_no_key_ends_it_and_what_is_kept_is_bounded(text):
    keys = Keys()
    keys.typed(text * 20)
    assert len(keys.prompt) < 1100
