"""Where the curves over a rollout's frames lie, and what a click in them means."""

from types import SimpleNamespace

import numpy as np
import pytest

from r2sego_blender.results.panels.view_chart import Chart, chart_in, covered_margins, curve, stems

CHART = Chart(left=100.0, bottom=20.0, width=200.0, height=50.0, first=10, last=30)


def test_frames_and_columns_are_each_others_inverse():
    for frame in (10, 17, 30):
        assert CHART.frame_at(CHART.x_of(frame)) == pytest.approx(frame)
    assert CHART.frame_at(-50.0) == 10 and CHART.frame_at(900.0) == 30
    assert CHART.x_of(10) == 100.0 and CHART.x_of(30) == 300.0
    np.testing.assert_allclose(CHART.y_of(np.array([0.0, 0.5, 1.0, 7.0])), [20.0, 45.0, 70.0, 70.0])


def test_a_rollout_of_one_frame_has_a_place_too():
    assert np.isfinite(Chart(0.0, 0.0, 10.0, 10.0, 4, 4).x_of(4))


def test_a_place_is_inside_or_beside():
    assert CHART.contains(100.0, 70.0)
    assert not CHART.contains(98.0, 30.0)
    assert CHART.contains(98.0, 30.0, slack=3.0)


def test_a_curve_has_gaps_where_frames_are_left_out():
    lines = curve(CHART, np.array([10, 11, 12, 20, 21]), np.linspace(0.0, 1.0, 5))
    assert lines.shape == (6, 2)
    np.testing.assert_allclose(lines[0], [100.0, 20.0])
    np.testing.assert_allclose(lines[1], lines[2])
    np.testing.assert_allclose(lines[-1], [210.0, 70.0])


def test_stems_stand_on_the_bottom():
    np.testing.assert_allclose(stems(CHART, np.array([30]), 0.5), [[300.0, 20.0], [300.0, 45.0]])
    assert stems(CHART, np.array([], int), 0.5).shape == (0, 2)


def test_the_chart_keeps_off_what_covers_the_region():
    chart = chart_in((1000.0, 600.0), (50.0, 240.0, 30.0), 1.0, np.arange(5, 90))
    assert (chart.left, chart.left + chart.width) == (62.0, 748.0)
    assert (chart.bottom, chart.first, chart.last) == (42.0, 5, 89)
    large = chart_in((1000.0, 600.0), (50.0, 240.0, 30.0), 2.0, np.arange(5, 90))
    assert large.height > chart.height


@pytest.mark.parametrize("size", [(180.0, 600.0), (1000.0, 60.0)])
def test_without_room_there_is_no_chart(size):
    assert chart_in(size, (20.0, 60.0, 0.0), 1.0, np.arange(9)) is None


def test_without_frames_there_is_no_chart():
    assert chart_in((1000.0, 600.0), (0.0, 0.0, 0.0), 1.0, np.array([], int)) is None


def test_covering_regions_are_measured_and_hidden_ones_are_not():
    def region(x, y, width, height):
        return SimpleNamespace(x=x, y=y, width=width, height=height)

    window = region(100, 50, 1000, 600)
    others = [
        region(100, 50, 40, 560),  # tools
        region(900, 50, 200, 560),  # side bar
        region(100, 50, 1000, 26),  # a header at the bottom
        region(100, 624, 1000, 26),  # a header at the top
        region(100, 50, 1, 600),  # hidden
        region(2000, 50, 300, 600),  # elsewhere on the screen
    ]
    assert covered_margins(window, others) == (40.0, 200.0, 26.0)
    assert covered_margins(window, []) == (0.0, 0.0, 0.0)
