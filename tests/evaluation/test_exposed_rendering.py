"""An asset at the exposure of the captures near a view: told by their gains alone."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from small_bundle import camera, photographs, splats

from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.evaluation.exposed_rendering import as_exposed, exposure_near
from r2sego_blender.splats.rendering.rasterizer import render

GAINS = [(0.5, 0.5, 0.4), (2.0, 1.6, 2.0)]


def _captures(tmp_path, gains, xs=(-1.0, 1.0)):
    made = photographs(tmp_path, xs, "capture")
    return [replace(capture, gain=gain) for capture, gain in zip(made, gains, strict=True)]


def test_without_gains_the_rendering_is_the_assets_to_the_bit(tmp_path):
    asset = splats(0.5)
    shown = as_exposed(asset, _captures(tmp_path, [None, None]))(camera())
    plain = render(asset, camera())
    for name in ("colour", "alpha", "depth"):
        assert np.array_equal(getattr(shown, name), getattr(plain, name))


def test_it_is_the_exposure_of_the_nearest_and_their_mean_in_between(tmp_path):
    captures = _captures(tmp_path, GAINS)
    np.testing.assert_allclose(exposure_near(camera(-1.0), captures), 1.0 / np.array(GAINS[0]), rtol=0.01)
    np.testing.assert_allclose(exposure_near(camera(), captures), 1.0 / np.sqrt(np.prod(GAINS, axis=0)), rtol=1e-5)
    # Who looks as the second does is exposed as that, where both stand as near.
    turned = replace(captures[1], camera=captures[1].camera.at(look_at((1.0, 0.0, 1.0), (3.0, 0.0, 0.9))))
    looks_so = camera().at(look_at((0.0, 0.0, 1.0), (2.0, 0.0, 0.9)))
    assert (exposure_near(looks_so, [captures[0], turned]) < exposure_near(looks_so, captures)).all()


def test_a_capture_without_a_gain_has_the_one_exposure(tmp_path):
    captures = _captures(tmp_path, [None, (4.0, 4.0, 4.0)])
    np.testing.assert_allclose(exposure_near(camera(), captures), 0.5, rtol=1e-5)


def test_a_held_out_photograph_is_met_at_the_exposure_that_its_camera_chose(tmp_path):
    """Photographs are grey 0.5 as taken; the room, at one exposure, is what the gains make of it."""
    captures = _captures(tmp_path, [(1.5, 1.5, 1.5)] * 2)
    grey = float(srgb_from_linear(1.5 * linear_from_srgb(np.float32(0.5))))
    plain, shown = (
        renderer(camera()) for renderer in (partial(render, splats(grey)), as_exposed(splats(grey), captures))
    )
    covered = plain.alpha > 0.99
    assert covered.mean() > 0.3 and np.abs(plain.colour[covered] - 0.5).min() > 0.05
    assert np.abs(shown.colour[covered] - 0.5).max() < 0.01
