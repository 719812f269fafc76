"""Pictures of the report: plans show the right colour in the right place."""

from __future__ import annotations

import numpy as np
import pytest
from room_meshes import observed_proxy

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import load_image
from r2sego_blender.evaluation.figures import (
    BACKGROUND,
    PROVENANCE_COLOURS,
    camera_map,
    depth_picture,
    save_figure,
    strip,
    top_view,
)
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance


def quad(x0: float, y0: float, x1: float, y1: float, z: float) -> np.ndarray:
    return np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], np.float32)


@pytest.fixture
def proxy() -> GeometryProxy:
    """A floor seen in captures, a prior at the west, a completed patch at the east, and a ceiling."""
    parts = [
        (quad(-2, -1, 2, 1, 0.0), Provenance.OBSERVED),
        (quad(-1.5, -0.5, -0.5, 0.5, 0.5), Provenance.PRIOR),
        (quad(0.5, 0.0, 1.5, 0.8, 0.5), Provenance.COMPLETED),
        (quad(-2, -1, 2, 1, 2.5), Provenance.OBSERVED),
    ]
    vertices = np.concatenate([corners for corners, _ in parts])
    faces = np.array([(4 * i + a, 4 * i + b, 4 * i + c) for i in range(4) for a, b, c in ((0, 1, 2), (0, 2, 3))])
    provenance = np.repeat([kind for _, kind in parts], 2).astype(np.uint8)
    ones = np.ones(len(faces))
    return GeometryProxy(vertices, faces.astype(np.int32), provenance, ones.astype(np.uint16), ones.astype(np.float32))


def colour_at(view, point) -> np.ndarray:
    column, row = view.pixels(np.array(point, float)).astype(int)
    return view.image[row, column]


def hue(colour: np.ndarray) -> np.ndarray:
    """The colour without its brightness."""
    return np.asarray(colour) / np.linalg.norm(colour)


@pytest.mark.parametrize(
    ("point", "kind"),
    [
        ((-1.0, 0.0, 0.5), Provenance.PRIOR),
        ((1.0, 0.4, 0.5), Provenance.COMPLETED),
        ((0.0, -0.7, 0.0), Provenance.OBSERVED),
    ],
)
def test_each_surface_has_its_provenance_colour(proxy, point, kind):
    view = top_view(proxy, width_px=400)
    assert hue(colour_at(view, point)) == pytest.approx(hue(PROVENANCE_COLOURS[kind]), abs=0.02)


def test_the_plan_is_to_scale_with_y_up_and_without_the_ceiling(proxy):
    view = top_view(proxy, width_px=400)
    assert view.image.shape[1] == 400
    east = view.pixels(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]))
    step = east[1] - east[0]
    assert step[1] == pytest.approx(0.0, abs=1e-9)
    assert east[2] - east[0] == pytest.approx((0.0, -step[0]), abs=1e-9)
    high = view.pixels(np.array([2.0, 1.0, 2.0])) - view.pixels(np.array([2.0, 1.0, 0.0]))
    assert np.abs(high).max() < 0.03 * step[0]
    assert view.image[2, 2] == pytest.approx(BACKGROUND, abs=1e-3)


def test_the_camera_map_marks_captures_and_targets(proxy):
    capture = Camera(64, 48, 40.0, 40.0, 32.0, 24.0, look_at((0.0, -0.6, 1.5), (0.0, 1.0, 1.0)))
    candidates = np.stack([look_at((x, 0.2, 1.2), (x, 1.0, 0.6)) for x in (-0.3, 0.3)])
    plain = camera_map(top_view(proxy, 300), [], candidates[:0], np.array([], int))
    marked = camera_map(top_view(proxy, 300), [capture], candidates, np.array([1]))
    assert plain.shape == marked.shape
    assert 20 < (np.abs(marked - plain).max(axis=-1) > 0.1).sum() < plain.shape[0] * plain.shape[1] / 4


def test_an_empty_proxy_has_an_empty_plan():
    nothing = observed_proxy(np.zeros((0, 3)), np.zeros((0, 3)))
    assert np.ptp(top_view(nothing, 120).image, axis=(0, 1)).max() == 0.0


def test_nearer_is_lighter_and_unknown_is_neither():
    depth = np.array([[1.0, 2.0, 4.0, 0.0]], np.float32)
    near, middle, far, unknown = depth_picture(depth)[0]
    assert near.sum() > middle.sum() > far.sum()
    assert unknown[0] > 2 * unknown[2]
    assert depth_picture(np.zeros((2, 2), np.float32)).shape == (2, 2, 3)


def test_a_strip_keeps_the_first_height_and_every_aspect():
    joined = strip([np.zeros((20, 30, 3), np.float32), np.ones((40, 20, 3), np.float32)], gap_px=4)
    assert joined.shape == (20, 30 + 4 + 10, 3)
    assert joined[:, :30].max() == 0.0
    assert joined[:, 34:].min() == 1.0


def test_figures_are_saved_from_memory_and_from_files(tmp_path):
    ramp = np.linspace(0, 1, 32 * 24 * 3).reshape(24, 32, 3).astype(np.float32)
    save_figure(tmp_path / "a.jpg", ramp)
    save_figure(tmp_path / "b.jpg", tmp_path / "a.jpg")
    assert np.abs(load_image(tmp_path / "b.jpg") - ramp).mean() < 0.03
