"""What the colours of the proxy's faces mean."""

import numpy as np
import pytest

from r2sego_blender.results.panels.proxy_colours import COLOURINGS, ProxyFaces, coloured
from r2sego_blender.results.panels.proxy_coverage import read_coverage


@pytest.fixture
def faces():
    rng = np.random.default_rng(0)
    return ProxyFaces(
        rng.integers(0, 3, 500), rng.integers(0, 9, 500), rng.random(500), rng.integers(0, 60, 500) * 2, 200
    )


@pytest.mark.parametrize("by", COLOURINGS)
def test_every_face_has_a_colour_of_its_own_kind(by, faces):
    colouring = coloured(by, faces)
    assert len(colouring.labels) == len(colouring.colours) == len(set(colouring.labels))
    assert len(set(colouring.colours)) == len(colouring.colours)
    assert set(np.unique(colouring.slot)) <= set(range(len(colouring.labels)))
    assert np.array(colouring.colours).min() >= 0 and np.array(colouring.colours).max() <= 1
    areas = colouring.areas_m2(np.arange(500.0))
    assert len(areas) == len(colouring.labels) and areas.sum() == pytest.approx(np.arange(500.0).sum())


def test_the_gap_is_what_the_robot_sees_without_captures():
    faces = ProxyFaces(np.zeros(5), np.array([0, 1, 2, 7, 0]), np.ones(5), np.array([3, 1, 9, 2, 0]), views=10)
    gap = coloured("SUPPORT_GAP", faces)
    assert gap.slot.tolist() == [0, 1, 2, 2, 3]
    coverage = coloured("COVERAGE", faces)
    assert [coverage.labels[k] for k in coverage.slot] == ["Robot alone"] + ["Robot and captures"] * 3 + ["Neither"]


def test_shares_of_views_and_confidence_fall_into_their_steps():
    faces = ProxyFaces(
        np.zeros(6),
        np.zeros(6),
        np.array([0.0, 0.19, 0.2, 0.99, 1.0, np.nan]),
        np.array([0, 1, 10, 11, 200, 201]),
        views=1000,
    )
    assert coloured("VIEWS", faces).slot.tolist() == [0, 1, 1, 2, 3, 4]
    assert coloured("CONFIDENCE", faces).slot.tolist() == [0, 0, 1, 4, 4, 0]


def test_what_was_not_measured_has_no_colours(faces):
    unmeasured = ProxyFaces(faces.provenance, faces.support, faces.confidence)
    for by, kind in COLOURINGS.items():
        assert (coloured(by, unmeasured) is None) == kind.needs_coverage


def test_a_coverage_of_another_proxy_is_not_shown(bundle):
    assert read_coverage(bundle, 0, 13).views == 40
    assert read_coverage(bundle, 0, 12) is None
    assert read_coverage(bundle, 1) is None
