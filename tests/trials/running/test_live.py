"""What an operator sees comes through JSON as it was."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.json_files import parse_json
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.running.live import Counts, Live, State

NUMBERS = st.floats(-1e6, 1e6)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
WHOLE = st.integers(0, 1000)
LIVES = st.builds(
    Live,
    next=TEXTS,
    label=TEXTS,
    chair=TEXTS,
    index=WHOLE,
    total=WHOLE,
    repetition=WHOLE,
    record=WHOLE,
    robot_pose=st.tuples(NUMBERS, NUMBERS, NUMBERS),
    chair_pose=st.tuples(NUMBERS, NUMBERS, NUMBERS),
    newtons=st.dictionaries(TEXTS, NUMBERS, max_size=8).map(lambda found: tuple(found.items())),
    rate_hz=NUMBERS,
    lost_share=NUMBERS,
    elapsed_s=NUMBERS,
    support_s=NUMBERS,
    outcome=st.none() | st.sampled_from(Outcome),
    reasons=st.lists(TEXTS, max_size=5).map(tuple),
    counts=st.none() | st.lists(st.builds(Counts, TEXTS, WHOLE, WHOLE, WHOLE), max_size=4).map(tuple),
)


@given(LIVES)
def test_it_comes_through_json_as_it_was(live):
    assert Live.from_json(parse_json(json.dumps(live.to_json()))) == live


def test_a_force_that_nothing_measured_is_null():
    live = Live(State.ARMED, "", 0, 1, "A", 0, True, (0, 0, 0), (1, 0, 0), "chair", newtons=(("seat", math.nan),))
    values = live.to_json()
    assert values["newtons"] == {"seat": None}
    assert math.isnan(Live.from_json(values).newtons[0][1])


@pytest.mark.parametrize(
    "change", [{"state": "x"}, {"robot_pose": [1]}, {"newtons": 3}, {"rate_hz": "a"}, {"index": []}]
)
def test_what_is_none_is_refused(change):
    live = Live(State.ARMED, "", 0, 1, "A", 0, True, (0, 0, 0), (1, 0, 0), "chair")
    with pytest.raises(ValueError):
        Live.from_json(live.to_json() | change)
