"""True depth disturbed: by as much as was asked, the same each time, and nowhere else than where it was known."""

import numpy as np
import pytest
from box_room import arc, render

from tools.studies.disturbed_depth import ALL, KINDS, disturbed, mean_relative_error
from tools.studies.scores import given_scores

TRUE = render(arc(3, 320, 240)[1])[1]
BARE = 0.03  # the room has few edges: blurred, they are off by a little more than this at most


def _disturbed(kind: str, error: float, seed: int = 0, true: np.ndarray = TRUE) -> np.ndarray:
    return disturbed(true, kind, error, np.random.default_rng(seed))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != ALL])
@pytest.mark.parametrize("error", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("seed", [0, 1])
def test_it_is_off_by_what_was_asked(kind, error, seed):
    found = mean_relative_error(_disturbed(kind, error, seed), TRUE)
    if kind == "edges" and error > BARE:
        assert BARE < found < 1.1 * error
    else:
        assert found == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize("error", [0.02, 0.05, 0.1])
def test_all_together_are_off_by_it_after_a_scale_and_a_shift(error):
    found = _disturbed(ALL, error)
    assert mean_relative_error(found, TRUE) > 1.5 * error  # before
    assert given_scores([found], [TRUE])["absrel"] == pytest.approx(error, rel=0.1)


def test_of_no_error_a_scale_and_a_shift_are_left():
    ratio = given_scores([_disturbed(ALL, 0.0)], [TRUE])
    assert ratio["absrel"] < 1e-6 and ratio["within_5_percent"] == 1.0
    for kind in KINDS[:-1]:
        np.testing.assert_allclose(_disturbed(kind, 0.0), TRUE, rtol=1e-4)


def test_a_scale_is_taken_away_by_a_scale_and_a_shift():
    assert given_scores([_disturbed("scale", 0.2)], [TRUE])["absrel"] < 1e-6


def test_edges_are_off_at_edges_and_a_smooth_error_everywhere():
    def far(kind: str, error: float) -> float:
        return float((np.abs(_disturbed(kind, error) / TRUE - 1.0) > error / 2.0).mean())

    assert far("edges", 0.01) < 0.3 and far("smooth", 0.01) > 0.6


def test_flat_failures_face_the_camera():
    found = _disturbed("flat", 0.05)
    off = np.abs(found / TRUE - 1.0) > 1e-6
    values, counts = np.unique(found[off], return_counts=True)
    assert 0.1 < off.mean() < 0.5 and len(values) < 100 and counts.max() > 300


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_generator_gives_the_same_map_another_another(kind):
    first = _disturbed(kind, 0.02)
    assert first.dtype == np.float32
    np.testing.assert_array_equal(first, _disturbed(kind, 0.02))
    if kind != "edges":
        assert (first != _disturbed(kind, 0.02, seed=1)).any()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("error", [0.05, 0.2])
def test_what_is_known_stays_known_and_nothing_else_is(kind, error):
    holes = np.random.default_rng(5).random(TRUE.shape) < 0.3
    holes[:40] = True
    true = np.where(holes, np.float32(0.0), TRUE)
    found = _disturbed(kind, error, true=true)
    np.testing.assert_array_equal(found > 0.0, ~holes)
    assert np.isfinite(found).all()
    assert not _disturbed(kind, error, true=np.zeros_like(TRUE)).any()
