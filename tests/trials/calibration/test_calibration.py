"""Calibrations find the cell that was simulated, say how straight it is, and come back as they were written."""

import json
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.calibration.calibration import Calibration, ChannelCalibration, Point
from r2sego_blender.trials.stream import Channel, Hello

TAKEN = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


def channel(name="tether", zero=84210.0, span=-812.5, loads=(0.0, 49.0, 98.0), bend=0.0):
    points = tuple(Point(load, zero + span * load + bend * load**2, 3.0) for load in loads)
    return ChannelCalibration(Channel(name, -(1 << 23), (1 << 23) - 1), points)


def calibration(*channels):
    return Calibration("cell-1", "0.9", TAKEN, channels or (channel(), channel("seat", -21340.0, 640.0)))


@given(
    st.floats(-1e6, 1e6),
    st.floats(1.0, 1e4) | st.floats(-1e4, -1.0),
    st.lists(st.floats(20, 500), min_size=1, max_size=9),
)
def test_a_straight_cell_is_found_and_inverted(zero, span, loads):
    found = channel(zero=zero, span=span, loads=[0.0, *loads])
    assert found.counts_per_newton == pytest.approx(span, rel=1e-6)
    assert max(map(abs, found.residuals_n)) < 1e-3
    newtons = np.array([[0.0], [-30.0], [333.0]])
    np.testing.assert_allclose(calibration(found).newtons(zero + span * newtons), newtons, atol=1e-3)


def test_channels_have_their_own_columns():
    both = calibration()
    np.testing.assert_allclose(
        both.newtons(np.array([[84210, -21340 + 6400], [84210 - 8125, -21340]])), [[0, 10], [10, 0]]
    )
    assert both.index("seat") == 1
    with pytest.raises(TrialError):
        both.index("foot")


def test_residuals_are_how_far_a_bent_cell_is_off():
    bent = channel(span=1000.0, bend=1.0)  # of a parabola through 0, 49, 98: 1/6, -1/3, 1/6 of its second difference
    np.testing.assert_allclose(bent.residuals_n, np.array([1, -2, 1]) / 6 * 2 * 49.0**2 / bent.counts_per_newton)


@pytest.mark.parametrize(
    "loads, span", [((0.0,), 800.0), ((5.0, 5.0), 800.0), ((0.0, 98.0), 0.01), ((0.0, 1e-300), 1.0)]
)
def test_points_that_make_no_line_are_refused(loads, span):
    with pytest.raises(TrialError):
        channel(loads=loads, span=span)


def test_what_is_written_is_what_is_read(tmp_path):
    file = tmp_path / "cells.json"
    calibration().save(file)
    assert Calibration.load(file) == calibration()
    assert Calibration.load(file).digest == calibration().digest != calibration(channel()).digest


def test_it_ages():
    assert calibration().age_days((TAKEN + timedelta(days=30)).timestamp()) == pytest.approx(30.0)


def test_it_is_of_one_device():
    channels = tuple(one.channel for one in calibration().channels)
    calibration().check_device(Hello(1, "cell-1", "1.0", 3, 80.0, channels))
    for device, of in (("cell-2", channels), ("cell-1", channels[::-1]), ("cell-1", channels[:1])):
        with pytest.raises(TrialError):
            calibration().check_device(Hello(1, device, "1.0", 3, 80.0, of))


@pytest.mark.parametrize(
    "change",
    [
        {"format": 2},
        {"taken": "2026-03-01T12:00:00"},
        {"taken": 5},
        {"channels": []},
        {"channels": [{}] * 9},
        {"channels": [{"name": "t", "lowest": 0, "highest": 1, "points": []}]},
        {"device": "a\u001b[2J"},
        {"channels": [{"name": "t", "lowest": 5, "highest": 1, "points": []}]},
        {"channels": [{"name": "t", "lowest": 0, "highest": 1, "points": [{"newtons": 1e300}]}]},
    ],
)
def test_damaged_files_are_refused_with_their_names(change, tmp_path):
    file = tmp_path / "cells.json"
    calibration().save(file)
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(TrialError, match=r"cells\.json"):
        Calibration.load(file)
