"""A person's judgement says whose it is, and makes no unusable recording count."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.judging.manual import manual_judgement
from r2sego_blender.trials.outcome import Failure, Judgement, Outcome, Unusable

REASONS = st.lists(st.tuples(st.sampled_from([*Failure, *Unusable]), st.text(max_size=10)), max_size=3).map(tuple)
SENSORS = st.builds(Judgement, st.sampled_from(Outcome), REASONS, st.floats(0, 10), st.floats(0, 500))


@given(SENSORS, st.sampled_from(Outcome))
def test_nobody_makes_an_unusable_recording_count(sensors, outcome):
    if sensors.outcome is Outcome.UNUSABLE and outcome is not Outcome.UNUSABLE:
        with pytest.raises(TrialError):
            manual_judgement(sensors, outcome.value, "A. Person", "seen on video")
        return
    judged = manual_judgement(sensors, outcome.value, " A. Person ", "seen on video")
    assert judged.outcome is outcome and judged.manual.startswith("A. Person")
    assert (judged.support_s, judged.highest_tether_n) == (sensors.support_s, sensors.highest_tether_n)
    assert bool(judged.reasons) == (outcome is not Outcome.SUCCESS)


@pytest.mark.parametrize(("outcome", "by", "why"), [("well", "A", "b"), ("success", " ", "b"), ("failure", "A", "")])
def test_it_has_an_outcome_a_name_and_a_reason(outcome, by, why):
    with pytest.raises(TrialError):
        manual_judgement(Judgement(Outcome.SUCCESS, (), 3.0, 1.0), outcome, by, why)
