"""The order in which a plan is walked through, and the gate of the tether."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from trials.declarations import declared

from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.next_trial import is_tethered, next_trial
from r2sego_blender.trials.plan.study import freeze_plan

OUTCOMES = st.sampled_from([*Outcome])


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    made = {}
    for rerun, tether in itertools.product(("at_once", "at_end"), ("gate", "always")):
        folder = tmp_path_factory.mktemp(f"{rerun}_{tether}")
        text = f'trials = 2\ntether = "{tether}"'
        made[rerun, tether] = freeze_plan(declared(folder, text, f'rerun = "{rerun}"'))[0]
    return made


def walked(plan, outcomes):
    """(trial, tethered, outcome) of all that are run with these outcomes, until the plan is done."""
    ended = []
    for outcome in outcomes:
        trial = next_trial(plan, ended)
        if trial is None:
            break
        ended.append((trial.index, is_tethered(trial, plan, ended), outcome))
    return ended


@given(outcomes=st.lists(OUTCOMES, min_size=60, max_size=60), rerun=st.sampled_from(["at_once", "at_end"]))
def test_every_trial_gets_one_usable_recording_in_order(plans, outcomes, rerun):
    plan = plans[rerun, "gate"]
    ended = walked(plan, [*outcomes, *[Outcome.FAILURE] * 12])
    usable = [index for index, _, outcome in ended if outcome is not Outcome.UNUSABLE]
    assert sorted(usable) == list(range(12))
    tried = list(dict.fromkeys(index for index, *_ in ended))
    assert tried == list(range(12))
    if rerun == "at_once":
        assert usable == list(range(12))
    else:
        assert [index for index, *_ in ended[:12]] == list(range(12))
    assert next_trial(plan, ended) is None


@given(outcomes=st.lists(OUTCOMES, min_size=60, max_size=60))
def test_untethered_only_after_a_tethered_success_of_the_same_policy(plans, outcomes):
    plan = plans["at_once", "gate"]
    passed = set()
    for index, tethered, outcome in walked(plan, outcomes):
        policy = plan.trials[index].policy_sha256
        assert tethered == (policy not in passed)
        if tethered and outcome is Outcome.SUCCESS:
            passed.add(policy)
    assert all(tethered for _, tethered, _ in walked(plans["at_once", "always"], outcomes))
