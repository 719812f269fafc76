"""The asset is shown while it trains, and trains as if nobody looked."""

import dataclasses

import numpy as np
from splat_reference import random_asset

from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.progress import Progress
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.observations import Observation
from r2sego_blender.splats.training.training import train
from r2sego_blender.splats.training.training_pictures import shown_from

SETTINGS = TrainingSettings(sh_degree=1, max_gaussians=1000)


class Gallery(Progress):
    """Keeps every picture, as one that looks after each step would."""

    def __init__(self):
        self.pictures = []

    def picture(self, title, make):
        self.pictures.append((title, make()))


def test_pictures_show_the_asset_of_now_and_change_nothing():
    asset = random_asset(np.random.default_rng(0), 200, degree=1)
    camera = Camera(640, 480, 640, 640, 320, 240, look_at([0.3, -0.2, -1.5], [0.0, 0.0, 2.0]))
    behind = np.full((480, 640, 3), 0.4, np.float32)
    view = Observation(camera, np.zeros((480, 640, 3), np.float32), background=behind)
    small = Observation(camera.scaled(0.1), np.zeros((48, 64, 3), np.float32))
    gallery = Gallery()
    watched = train(
        asset, [view], 5, SETTINGS, np.random.default_rng(1), watch=shown_from([view, small], "Training", gallery)
    )
    alone = train(asset, [view], 5, SETTINGS, np.random.default_rng(1))
    for name in ("means", "log_scales", "quaternions", "logit_opacities", "sh"):
        assert np.array_equal(getattr(watched, name), getattr(alone, name)), name
    assert [title for title, _ in gallery.pictures] == ["Training"] * 5
    assert [picture.shape[1] for _, picture in gallery.pictures] == [320, 64, 320, 64, 320]
    last = gallery.pictures[-1][1]
    expected = np.clip(render(watched, camera.scaled(0.5), (0.4, 0.4, 0.4)).colour, 0.0, 1.0)
    assert last.shape == (240, 320, 3)
    assert np.abs(last - expected).max() < 1e-5


def test_small_views_without_a_background_are_shown_as_they_are():
    asset = random_asset(np.random.default_rng(0), 50)
    camera = Camera(64, 48, 64, 64, 32, 24, look_at([0.0, -0.2, -1.5], [0.0, 0.0, 2.0]))
    view = Observation(camera, np.zeros((48, 64, 3), np.float32))
    gallery = Gallery()
    settings = dataclasses.replace(SETTINGS, sh_degree=0)
    train(asset, [view], 1, settings, np.random.default_rng(1), watch=shown_from([view], "One", gallery))
    ((_, picture),) = gallery.pictures
    assert picture.shape == (48, 64, 3)
