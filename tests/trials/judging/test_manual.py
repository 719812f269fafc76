"""What a person may say of a trial."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.judging.manual import manual_judgement
from r2sego_blender.trials.outcome import Failure, Judgement, Outcome, Unusable

SUCCESS = Judgement(Outcome.SUCCESS, (), 3.5, 2.0)
FELL = Judgement(Outcome.FAILURE, ((Failure.TETHER, "212.0 N"),), 0.0, 212.0)
GAP = Judgement(Outcome.UNUSABLE, ((Unusable.GAP, "80 ms"), (Failure.TETHER, "212.0 N")), 3.5, 212.0)


def test_what_a_person_says_counts_and_is_theirs():
    said = manual_judgement(FELL, "success", "Ada", "the rope was pulled by hand")
    assert said.outcome is Outcome.SUCCESS and said.reasons == () and "Ada" in said.manual
    assert (said.support_s, said.highest_tether_n) == (0.0, 212.0)
    assert manual_judgement(FELL, "failure", "Ada").reasons == FELL.reasons
    assert manual_judgement(SUCCESS, "failure", "Ada", "on the armrest").reasons == (
        (Failure.OBSERVED, "on the armrest"),
    )
    assert manual_judgement(SUCCESS, "unusable", "Ada", "wrong chair").reasons == ((Unusable.ABORTED, "wrong chair"),)


@given(
    said=st.lists(st.sampled_from(["success", "failure", "unusable"]), max_size=5),
    start=st.sampled_from([GAP, FELL, SUCCESS]),
)
def test_no_sequence_of_judgements_makes_an_unusable_recording_a_success(said, start):
    judgement, spoilt = start, start is GAP
    for outcome in said:
        if spoilt and outcome == "success":
            with pytest.raises(TrialError):
                manual_judgement(judgement, outcome, "Ada")
            continue
        judgement = manual_judgement(judgement, outcome, "Ada")
        spoilt |= outcome == "unusable"
        assert judgement.outcome.value == outcome
    assert not spoilt or judgement.outcome is not Outcome.SUCCESS


@pytest.mark.parametrize(("outcome", "by"), [("success", ""), ("success", " "), ("won", "Ada"), ("SUCCESS", "Ada")])
def test_a_judgement_is_somebodys_and_one_of_three(outcome, by):
    with pytest.raises(TrialError):
        manual_judgement(SUCCESS, outcome, by)
