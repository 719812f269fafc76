"""What two numbers that are compared read like."""

import numpy as np
import pytest

from r2sego_blender.captures.solving.pose_refinement import RefinedPose
from r2sego_blender.config.settings import RegistrationSettings
from r2sego_blender.core.formatting import counted, markdown_text, share, share_apart, told_apart
from r2sego_blender.generation.registration.frame_registration import _uncertain
from r2sego_blender.geometry.collision.collision_check import CollisionCheck
from r2sego_blender.robot.scope.region import problem_of


@pytest.mark.parametrize(
    ("value", "limit", "digits", "told"),
    [
        (0.0312, 0.03, 3, "0.031"),
        (0.0301, 0.03, 3, "0.0301"),
        (0.0300004, 0.03, 3, "0.0300004"),
        (0.0299, 0.03, 2, "0.0299"),
        (0.0306, 0.0309, 3, "0.0306"),  # 0.031 would be on the other side
        (0.03, 0.03, 3, "0.030"),
        (float("inf"), 0.03, 3, "inf"),
    ],
)
def test_a_number_reads_on_its_side_of_the_limit(value, limit, digits, told):
    assert told_apart(value, limit, digits) == told


def test_shares_and_sizes_are_told_apart_too():
    assert [share_apart(value, 0.25) for value in (0.1, 0.2499, 0.31)] == ["10%", "24.99%", "31%"]
    assert [share(value) for value in (0.25, 0.025)] == ["25%", "2.5%"]
    assert told_apart(0.09999, 0.1, 3, "g") == "0.09999"


def test_a_view_that_is_hardly_too_uncertain_reads_so():
    covariance = np.diag([0.0301, 0.001, 0.001, 0.0, 0.0, 0.0, 0.0]) ** 2
    refined = RefinedPose(None, covariance, np.ones(4, bool))
    said = _uncertain(refined, RegistrationSettings(max_sigma_m=0.03), "is")
    assert said == "its place is uncertain by 0.0301 m, 0.03 are allowed"


def test_a_sphere_that_floats_hardly_too_high_reads_so():
    ends = np.array([[1.0, 2.0, 0.1]])
    found = CollisionCheck(
        pieces=1,
        vertex_error_m=0.0,
        starts=ends + 1.0,
        ends=ends,
        at_rest=np.array([True]),
        fell_through=np.zeros(1, bool),
        left=np.zeros(1, bool),
        gap_m=np.array([0.0302]),
        proxy_gap_m=np.full(1, np.nan),
        simulated_s=1.0,
    )
    assert "one rests 3.02 cm off, 3 cm are allowed" in found.failures


def test_a_region_that_is_hardly_too_small_reads_so():
    corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.09999), (0.0, 0.09999)]
    assert problem_of(corners) == "has 0.04999 square metres, not 0.05 to 1000"


def test_one_of_a_kind_is_singular():
    assert [counted(count, "mask") for count in (0, 1, 2)] == ["0 masks", "1 mask", "2 masks"]


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("a|b\\", "a\\|b\\\\"),
        ("<script>", "\\<script>"),
        ("![x](https://example.org/x.png)", "![x\\](https://example.org/x.png)"),
        ("[x]: https://example.org", "[x\\]: https://example.org"),
        ("+0.51 [+0.20, +0.82] to walk_and_look", "+0.51 [+0.20, +0.82] to walk_and_look"),
    ],
)
def test_a_name_in_a_table_is_neither_html_nor_a_link(name, written):
    assert markdown_text(name) == written
