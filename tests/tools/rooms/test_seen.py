"""Overlap of captures and the support gap, against cases counted by hand."""

import pytest
from wall_views import camera, wall

from tools.rooms.seen import overlap_share, support_gap


def test_the_same_view_twice_overlaps_wholly_and_views_side_by_side_not_at_all():
    cameras = [camera(0.0), camera(0.0)]
    assert overlap_share(cameras, [wall(one) for one in cameras]) == 1.0
    cameras = [camera(0.0), camera(2.001)]
    assert overlap_share(cameras, [wall(one) for one in cameras]) == 0.0
    assert overlap_share(cameras[:1], [wall(cameras[0])]) == 0.0


def test_a_quarter_of_two_pictures_is_shared_where_the_second_stands_three_quarters_aside():
    cameras = [camera(0.0), camera(1.5)]
    assert overlap_share(cameras, [wall(one) for one in cameras]) == pytest.approx(0.25)


def test_the_support_gap_is_what_no_capture_saw():
    frozen = camera(0.0)
    aside = camera(0.5)  # sees the right three quarters of it
    below = camera(-0.5)  # sees the left three quarters of it
    seen = [frozen], [wall(frozen)]
    assert support_gap(*seen, [aside], [wall(aside)]) == pytest.approx(0.25)
    assert support_gap(*seen, [aside, below], [wall(aside), wall(below)]) == 0.0
    assert support_gap(*seen, [], []) == 1.0


def test_what_stands_before_the_wall_hides_it_and_pixels_without_surface_count_for_nothing():
    frozen, capture = camera(0.0), camera(0.0)
    hidden = wall(capture)
    hidden[:, :10] = 1.0  # a post before the left quarter
    assert support_gap([frozen], [wall(frozen)], [capture], [hidden]) == pytest.approx(0.25)
    open_sky = wall(frozen)
    open_sky[:, :10] = 0.0
    assert support_gap([frozen], [open_sky], [capture], [hidden]) == 0.0
    assert support_gap([frozen], [wall(frozen)], [capture], [open_sky]) == pytest.approx(0.25)
