"""Judgements of streams whose truth is known; a recording that was spoilt is never a success."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trials.streams import (
    BEGAN_NS,
    CHANNELS,
    calibration,
    events,
    kept,
    sits,
    stream,
    with_drift,
    with_flag,
    with_gap,
    with_loss,
    with_passing_drift,
    with_saturation,
    with_silence,
    with_stall,
    with_time,
)

from r2sego_blender.trials.events import EventKind
from r2sego_blender.trials.judging.judge import judge
from r2sego_blender.trials.outcome import Failure, Outcome, Unusable
from r2sego_blender.trials.plan.rules import Rules
from r2sego_blender.trials.stream import Flags

RULES = Rules()


def judged(one, told=None, days=1.0, rules=RULES):
    return judge(one, told or events(), calibration(days, one.channels), rules)


def kinds(judgement):
    return [kind for kind, _ in judgement.reasons]


def test_a_robot_that_sits_long_enough_succeeds():
    judgement = judged(stream(loads=sits(4.0)))
    assert judgement.outcome is Outcome.SUCCESS and judgement.reasons == ()
    assert judgement.support_s == pytest.approx(6.0, abs=0.006) and judgement.highest_tether_n == 0.0


@pytest.mark.parametrize(("until_s", "outcome"), [(7.0, Outcome.SUCCESS), (6.995, Outcome.FAILURE)])
def test_three_seconds_are_three_seconds(until_s, outcome):
    judgement = judged(stream(loads=sits(4.0, until_s)))
    assert judgement.outcome is outcome
    assert kinds(judgement) == ([] if outcome is Outcome.SUCCESS else [Failure.NO_SUPPORT])
    assert judgement.support_s == pytest.approx(until_s - 4.0, abs=1e-9)


@pytest.mark.parametrize(
    ("tether_n", "outcome"), [(RULES.tether_n, Outcome.SUCCESS), (RULES.tether_n + 0.01, Outcome.FAILURE)]
)
def test_a_tether_that_bears_load_is_a_failure(tether_n, outcome):
    judgement = judged(stream(loads=sits(4.0, tether_n=tether_n)))
    assert judgement.outcome is outcome and judgement.highest_tether_n == pytest.approx(tether_n)
    assert kinds(judgement) == ([Failure.TETHER] if outcome is Outcome.FAILURE else [])


@pytest.mark.parametrize(
    ("kind", "failure"),
    [
        (EventKind.INTERVENTION, Failure.INTERVENTION),
        (EventKind.EMERGENCY_STOP, Failure.EMERGENCY_STOP),
        (EventKind.NOTE, None),
    ],
)
def test_what_the_operator_did_counts_between_start_and_end(kind, failure):
    one = stream(loads=sits(4.0))
    during = judged(one, events(10.0, (kind, 9.9)))
    assert kinds(during) == ([failure] if failure else [])
    for at_s in (-0.1, 10.1):
        assert judged(one, events(10.0, (kind, at_s))).outcome is Outcome.SUCCESS


def test_the_button_of_the_device_is_an_emergency_stop():
    judgement = judged(with_flag(stream(loads=sits(4.0)), 0.5, Flags.EMERGENCY_STOP))
    assert judgement.outcome is Outcome.FAILURE and kinds(judgement) == [Failure.EMERGENCY_STOP]


def test_failures_are_told_in_the_order_in_which_they_came():
    """The first is the cause that is counted."""
    one = stream(loads=lambda since_s: (np.where(since_s > 3.0, 400.0, 0.0), 0.0))
    told = events(10.0, (EventKind.INTERVENTION, 4.0))
    assert kinds(judged(one, told)) == [Failure.TETHER, Failure.INTERVENTION]
    told = events(10.0, (EventKind.INTERVENTION, 2.0))
    assert kinds(judged(one, told)) == [Failure.INTERVENTION, Failure.TETHER]


def test_support_that_comes_too_late_is_out_of_time():
    rules = dataclasses.replace(RULES, timeout_s=6.0)
    assert kinds(judged(stream(loads=sits(4.0)), rules=rules)) == [Failure.TIMEOUT]
    assert judged(stream(loads=sits(2.9)), rules=rules).outcome is Outcome.SUCCESS
    assert kinds(judged(stream(), rules=rules)) == [Failure.TIMEOUT]


def test_support_that_shakes_is_none():

    def shaking(since_s):
        return (0.0, 260.0 + 200.0 * np.sin(2 * np.pi * since_s))

    least = 60.0 / 460.0
    assert judged(stream(loads=shaking), rules=dataclasses.replace(RULES, seat_n=50.0)).outcome is Outcome.FAILURE
    calmer = dataclasses.replace(RULES, seat_n=50.0, stability=0.99 * least)
    assert judged(stream(loads=shaking), rules=calmer).outcome is Outcome.SUCCESS


def test_the_thump_of_sitting_down_is_not_part_of_the_support():

    def thump(since_s):
        return (0.0, np.where(since_s < 3.0, 0.0, np.where(since_s < 3.1, 900.0, 250.0)))

    judgement = judged(stream(loads=thump))
    assert judgement.outcome is Outcome.SUCCESS and judgement.support_s == pytest.approx(6.9, abs=0.01)


@pytest.mark.parametrize(
    ("told", "kind"),
    [
        ([], Unusable.ABORTED),
        (events()[:1], Unusable.CUT_OFF),
        (events()[1:], Unusable.ABORTED),
        (events(10.0, (EventKind.ABORTED, 8.0)), Unusable.ABORTED),
        (events(20.0), Unusable.SILENCE),
    ],
)
def test_a_trial_without_its_whole_is_unusable(told, kind):
    judgement = judge(stream(loads=sits(4.0)), told, calibration(), RULES)
    assert judgement.outcome is Outcome.UNUSABLE and kind in kinds(judgement)


def test_why_a_trial_was_called_off_before_it_began_is_told():
    called_off = [dataclasses.replace(events()[-1], kind=EventKind.ABORTED, text="the wrong chair"), events()[-1]]
    ((kind, text),) = judged(stream(), called_off).reasons
    assert kind is Unusable.ABORTED and text.endswith("the wrong chair")


def test_a_device_that_is_silent_as_the_trial_begins_is_unusable():
    told = [dataclasses.replace(event, time_ns=event.time_ns - 10**9 * (at == 0)) for at, event in enumerate(events())]
    judgement = judged(stream(loads=sits(4.0)), told)
    assert judgement.outcome is Outcome.UNUSABLE and kinds(judgement) == [Unusable.SILENCE]


def test_calling_a_trial_off_after_its_end_changes_nothing():
    assert judged(stream(), events(10.0, (EventKind.ABORTED, 10.05))).outcome is Outcome.FAILURE


OTHERS = (CHANNELS[:1], CHANNELS[::-1])


@pytest.mark.parametrize(
    "given_one", [None, calibration(30.001), calibration(-0.001), *(calibration(channels=other) for other in OTHERS)]
)
def test_without_a_calibration_of_these_days_nothing_is_judged(given_one):
    judgement = judge(stream(loads=sits(4.0)), events(), given_one, RULES)
    assert judgement.outcome is Outcome.UNUSABLE and kinds(judgement)[0] is Unusable.CALIBRATION


@pytest.mark.parametrize("missing", [0, 1])
def test_a_device_without_tether_or_seat_judges_nothing(missing):
    one = stream(loads=sits(4.0))
    channels = (one.channels[1 - missing],)
    only = dataclasses.replace(one, channels=channels, raw=one.raw[:, [1 - missing]])
    assert judged(only).outcome is Outcome.UNUSABLE


def test_cells_of_one_seat_bear_together():
    one = stream(loads=sits(4.0, load_n=60.0))
    assert judged(one).outcome is Outcome.FAILURE
    channels = (*one.channels, dataclasses.replace(one.channels[1], name="seat_left"))
    both = dataclasses.replace(one, channels=channels, raw=one.raw[:, [0, 1, 1]])
    assert judged(both).outcome is Outcome.SUCCESS


def test_an_unusable_recording_tells_what_was_seen_in_it():

    def falls(since_s):
        return (np.where(since_s > 3.0, 400.0, 0.0), 0.0)

    judgement = judged(with_saturation(stream(loads=falls), 0.9, 0, high=True))
    assert judgement.outcome is Outcome.UNUSABLE and kinds(judgement) == [Unusable.SATURATION, Failure.TETHER]


def test_a_stream_without_samples_is_silence():
    judgement = judged(kept(stream(), slice(0, 0)))
    assert judgement.outcome is Outcome.UNUSABLE and Unusable.SILENCE in kinds(judgement)


def test_what_is_just_within_the_rules_is_usable():
    """A thousandth lost, 50 ms without a sample, a clock 0.9 % off, 190 ms of silence: still a success."""
    one = stream(30.0, 200.0, sits(4.0), delay_us=0)
    told = events(30.0)
    for good in (
        kept(one, np.setdiff1d(np.arange(len(one.sequence)), [1000, 2000, 3000, 4000, 5000])),
        with_drift(one, 0.009),
        with_drift(one, -0.009),
        with_stall(one, 0.5, 190.0),
        with_stall(one, 0.99, 190.0),
        with_passing_drift(one, 10.0, 3.0, 0.009),
    ):
        assert judged(good, told).outcome is Outcome.SUCCESS
    slow = stream(30.0, 20.0, sits(4.0), delay_us=0)
    assert judged(slow, told).outcome is Outcome.SUCCESS


@settings(deadline=None, max_examples=60)
@given(from_s=st.floats(0.0, 27.0), percent=st.integers(3, 20), seconds=st.floats(3.0, 10.0), faster=st.booleans())
def test_a_clock_that_drifts_only_for_a_while_is_found(from_s, percent, seconds, faster):
    """It would make a support of three seconds of a shorter one."""
    one = stream(30.0, 200.0, sits(4.0))
    share = percent / 100 if faster else -percent / 100
    judgement = judged(with_passing_drift(one, from_s, min(seconds, 30.0 - from_s), share), events(30.0))
    assert judgement.outcome is Outcome.UNUSABLE and kinds(judgement) == [Unusable.CLOCK_DRIFT]


SPOILT = {
    Unusable.GAP: lambda one, at, much, which: with_gap(one, at, 50.0 + 500.0 * much),
    Unusable.LOSS: lambda one, at, much, which: with_loss(one, at, 0.001 + 0.3 * much),
    Unusable.SATURATION: lambda one, at, much, which: (
        with_flag(one, at) if which == 2 else with_saturation(one, at, which % 2, high=much > 0.5)
    ),
    Unusable.SENSOR_FAULT: lambda one, at, much, which: with_flag(one, at, Flags.SENSOR_FAULT),
    Unusable.RESET: lambda one, at, much, which: with_time(one, "resets_ns", at),
    Unusable.DISCONNECTED: lambda one, at, much, which: with_time(one, "lost_ns", at),
    Unusable.CLOCK_DRIFT: lambda one, at, much, which: with_drift(one, (0.0102 + 0.2 * much) * (-1) ** which),
    Unusable.SILENCE: lambda one, at, much, which: with_silence(one, at, 200.1 + 2000.0 * much),
}

SHARE = st.floats(0.0, 1.0)


@settings(deadline=None, max_examples=150)
@given(
    kind=st.sampled_from([*SPOILT, Unusable.CALIBRATION]),
    at=SHARE,
    much=SHARE,
    which=st.integers(0, 3),
    rate_hz=st.sampled_from([25.0, 80.0, 200.0, 1000.0]),
    seconds=st.floats(5.0, 20.0),
    delay_us=st.sampled_from([0, 500, 3000]),
    seed=st.integers(0, 99),
)
def test_a_spoilt_recording_is_never_a_success(kind, at, much, which, rate_hz, seconds, delay_us, seed):
    good = stream(seconds, rate_hz, sits(1.0), delay_us, seed)
    told = events(seconds)
    assert judged(good, told).outcome is Outcome.SUCCESS
    if kind is Unusable.CALIBRATION:
        judgement = judged(good, told, 30.0 + 1e-6 + 1000.0 * much)
    else:
        judgement = judged(SPOILT[kind](good, at, much, which), told)
    assert judgement.outcome is Outcome.UNUSABLE and kind in kinds(judgement)


@settings(deadline=None, max_examples=60)
@given(
    spoils=st.lists(st.tuples(st.sampled_from([*SPOILT]), SHARE, SHARE, st.integers(0, 3)), min_size=1, max_size=3),
    tether_n=st.floats(0.0, 100.0),
    from_s=st.floats(0.0, 9.0),
)
def test_nothing_makes_a_spoilt_recording_a_success(spoils, tether_n, from_s):
    """Several defects one on another, of robots that sit, hang or fall."""
    one = stream(loads=sits(from_s, tether_n=tether_n))
    for kind, at, much, which in spoils:
        if len(one.sequence) > 4:
            one = SPOILT[kind](one, at, much, which)
    told = {kind for kind, *_ in spoils}
    if told != {Unusable.CLOCK_DRIFT} or len(spoils) == 1:  # two drifts can be none
        assert judged(one).outcome is not Outcome.SUCCESS


def test_a_judgement_is_the_same_again_and_leaves_the_stream_as_it_was():
    one = stream(loads=sits(4.0, tether_n=12.5))
    before = {name: np.copy(value) for name, value in vars(one).items() if isinstance(value, np.ndarray)}
    first = judged(one)
    for _ in range(3):
        assert judged(dataclasses.replace(one, **before)) == first
    assert all((getattr(one, name) == value).all() for name, value in before.items())


def test_an_hour_later_by_the_clock_is_the_same_judgement():
    one = stream(loads=sits(4.0))
    hour = 3600 * 10**9
    later = dataclasses.replace(one, received_ns=one.received_ns + hour)
    told = [dataclasses.replace(event, time_ns=event.time_ns + hour) for event in events()]
    assert judge(later, told, calibration(), RULES) == judged(one)
    assert BEGAN_NS + hour == told[0].time_ns
