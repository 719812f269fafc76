"""The study's scores against what can be counted by hand."""

import numpy as np
import pytest

from r2sego_blender.evaluation.surfaces.geometry_errors import within
from tools.studies.scores import calibration, given_scores, nearer_to

TRUE = np.array([[1.0, 2.0, 4.0, 0.0]])


def test_pixels_right_within_a_share_of_the_truth():
    found = np.array([[1.04, 2.11, 0.0, 7.0]])
    assert within([found], [TRUE], 0.05) == pytest.approx(1 / 3)
    assert within([found], [TRUE], 0.10) == pytest.approx(2 / 3)
    assert within([found, TRUE], [TRUE, TRUE], 0.05) == pytest.approx(4 / 6)  # of all pixels together
    assert within([TRUE], [np.zeros_like(TRUE)], 0.05) == 0.0


def test_errors_counted_in_their_own_sigmas():
    sigma = np.full_like(TRUE, 0.1)
    found = calibration([TRUE * np.exp([[0.05, -0.15, 0.25, 9.0]])], [sigma], [TRUE])
    assert [found[f"within_{count}"] for count in (1, 2, 3)] == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert found["stated"] == pytest.approx(0.1) and found["measured"] == pytest.approx(1.4826 * 0.15)
    assert found["valid"] == 1.0


def test_what_is_not_estimated_is_no_error_of_its():
    found = calibration([np.array([[1.0, 0.0, 4.0, 5.0]])], [np.full_like(TRUE, 0.1)], [TRUE])
    assert found["valid"] == pytest.approx(2 / 3) and found["within_1"] == 1.0
    assert calibration([np.zeros_like(TRUE)], [np.zeros_like(TRUE)], [TRUE]) == {"valid": 0.0}


def test_normal_errors_lie_within_their_sigmas_as_often_as_they_should():
    rng = np.random.default_rng(0)
    true = rng.uniform(1.0, 5.0, (300, 300))
    sigma = rng.uniform(0.02, 0.1, true.shape)
    found = calibration([true * np.exp(sigma * rng.standard_normal(true.shape))], [sigma], [true])
    assert [found[f"within_{count}"] for count in (1, 2, 3)] == pytest.approx([0.683, 0.954, 0.997], abs=0.01)


def test_an_estimate_in_any_unit_is_scored_after_its_scale_and_shift():
    true = np.linspace(1.0, 4.0, 400).reshape(20, 20)
    found = given_scores([7.0 * true + 3.0, 0.2 * true - 0.1], [true, true])
    assert found["absrel"] < 1e-6 and found["within_5_percent"] == 1.0


def test_a_few_failures_do_not_move_what_the_others_are_brought_to():
    true = np.linspace(1.0, 4.0, 400).reshape(20, 20)
    depth = true.copy()
    depth[:, :2] *= 1.5
    found = given_scores([3.0 * depth + 1.0], [true])
    assert found["absrel"] == pytest.approx(0.05, rel=0.05)
    assert found["within_5_percent"] == pytest.approx(0.9, abs=0.005)


def test_the_best_of_two_maps_is_what_lies_nearer_to_the_truth():
    one, other = np.array([[1.5, 2.0, 3.0]]), np.array([[1.1, 0.0, 6.0]])
    np.testing.assert_array_equal(nearer_to(TRUE[:, :3], one, other), [[1.1, 2.0, 3.0]])
