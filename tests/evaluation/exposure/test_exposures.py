"""An asset at the exposure that the captures' camera would choose: told by the captures alone."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from small_bundle import FACES, VERTICES, bundle, camera, photographs, splats

from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.exposure.exposures import Exposures, exposures_of
from r2sego_blender.geometry.stereo.stereo import DEPTH, DepthMap
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.rendering.rasterizer import render

GAINS = [(0.5, 0.5, 0.4), (2.0, 1.6, 2.0)]
METERED = 0.18


def _captures(tmp_path, gains, xs=(-1.0, 1.0)):
    made = photographs(tmp_path, xs, "capture")
    return [replace(capture, gain=gain) for capture, gain in zip(made, gains, strict=True)]


def test_without_gains_the_rendering_is_the_assets_to_the_bit(tmp_path):
    asset = splats(0.5)
    shown = Exposures(_captures(tmp_path, [None, None])).renderer(asset)(camera())
    plain = render(asset, camera())
    for name in ("colour", "alpha", "depth"):
        assert np.array_equal(getattr(shown, name), getattr(plain, name))


def test_it_is_the_exposure_of_the_nearest_and_their_mean_in_between(tmp_path):
    captures = _captures(tmp_path, GAINS)
    exposures = Exposures(captures)
    np.testing.assert_allclose(exposures.of(camera(-1.0)), 1.0 / np.array(GAINS[0]), rtol=0.01)
    np.testing.assert_allclose(exposures.of(camera()), 1.0 / np.sqrt(np.prod(GAINS, axis=0)), rtol=1e-5)
    # Who looks as the second does is exposed as that, where both stand as near.
    turned = replace(captures[1], camera=captures[1].camera.at(look_at((1.0, 0.0, 1.0), (3.0, 0.0, 0.9))))
    looks_so = camera().at(look_at((0.0, 0.0, 1.0), (2.0, 0.0, 0.9)))
    assert (Exposures([captures[0], turned]).of(looks_so) < exposures.of(looks_so)).all()


def test_a_capture_without_a_gain_has_the_one_exposure(tmp_path):
    captures = _captures(tmp_path, [None, (4.0, 4.0, 4.0)])
    np.testing.assert_allclose(Exposures(captures).of(camera()), 0.5, rtol=1e-5)


def test_a_held_out_photograph_is_met_at_the_exposure_that_its_camera_chose(tmp_path):
    """Photographs are grey 0.5 as taken; the room, at one exposure, is what the gains make of it."""
    captures = _captures(tmp_path, [(1.5, 1.5, 1.5)] * 2)
    grey = float(srgb_from_linear(1.5 * linear_from_srgb(np.float32(0.5))))
    renderers = (partial(render, splats(grey)), Exposures(captures).renderer(splats(grey)))
    plain, shown = (renderer(camera()) for renderer in renderers)
    covered = plain.alpha > 0.99
    assert covered.mean() > 0.3 and np.abs(plain.colour[covered] - 0.5).min() > 0.05
    assert np.abs(shown.colour[covered] - 0.5).max() < 0.01


def _dark_and_bright_wall(scene, xs):
    """Captures along a wall that is dark on the left and bright on the right, by a camera that exposes by itself."""
    captures = []
    (scene.path / DEPTH.name).mkdir(parents=True)
    for one in photographs(scene.path.parent, xs, "capture"):
        seen = MeshRasterizer(VERTICES, FACES).render(one.camera)
        room = _room(one.camera)
        gain = float(room.mean() / METERED)
        save_image(one.image_path, srgb_from_linear(room / gain))
        captures.append(replace(one, gain=(gain,) * 3))
        sure = np.zeros(one.camera.shape, np.float32), np.ones(one.camera.shape, np.uint8)
        depth = DepthMap(seen.depth, np.zeros((*one.camera.shape, 3), np.float32), *sure, one.camera)
        depth.save(scene.path / DEPTH.name / f"{one.name}.npz")
    save_captures(scene.captures_folder, captures)


def _room(of):
    """Linear light (H, W, 3) of what a camera sees of it."""
    depth = MeshRasterizer(VERTICES, FACES).render(of).depth
    right = ((of.rays() * depth[..., None]) @ of.world_from_camera[:3, :3].T + of.centre)[..., 0] > 0.0
    return np.where(depth > 0.0, np.where(right, 0.5, 0.03), 0.1)[..., None].repeat(3, axis=-1).astype(np.float32)


def test_with_a_proxy_it_follows_what_the_view_looks_at(tmp_path):
    scene = bundle(tmp_path, [splats(0.9)], SplatAsset.empty())
    _dark_and_bright_wall(scene, (-2.2, -1.1, 0.0, 1.1, 2.2))
    exposures, near = exposures_of(scene), Exposures(scene.read(CAPTURES))
    off, off_near = [], []
    for x in (-0.6, -0.3, 0.5, 0.8):
        true = METERED / _room(camera(x)).mean()
        off.append(np.abs(np.log(exposures.of(camera(x)) / true)).max())
        off_near.append(np.abs(np.log(near.of(camera(x)) / true)).max())
    assert max(off) < 0.05 and max(off_near) > 0.25
    assert (exposures_of(scene).of(camera(0.3)) == exposures.of(camera(0.3))).all()
