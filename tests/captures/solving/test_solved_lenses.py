"""A solved lens that folds the picture's corners over is made plain; any other is left to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.colmap import load_pycolmap
from r2sego_blender.captures.poses.colmap_model import camera_to_json, lens_from_json
from r2sego_blender.captures.solving.solved_lenses import with_lenses_that_can_be_undone
from r2sego_blender.core.errors import CaptureError


def _model(radial: float):
    pycolmap = load_pycolmap()
    pycolmap.set_random_seed(0)
    options = pycolmap.SyntheticDatasetOptions(camera_params=[900.0, 512.0, 384.0, radial])
    return pycolmap.synthesize_dataset(options)


def test_a_lens_that_folds_over_is_made_plain():
    model = _model(0.0)
    for camera in model.cameras.values():
        camera.params = [850.0, 512.0, 384.0, -4.0]
        with pytest.raises(CaptureError):
            lens_from_json(camera_to_json(camera), "").straight(np.eye(4))
    for camera in with_lenses_that_can_be_undone(model).cameras.values():
        lens = lens_from_json(camera_to_json(camera), "")
        assert not lens.distorts
        assert lens.fx == pytest.approx(900.0, rel=1e-3)
    assert model.compute_mean_reprojection_error() < 0.05


def test_other_lenses_are_left_as_they_are():
    model = _model(-0.05)
    poses = {key: image.cam_from_world().matrix() for key, image in model.images.items()}
    with_lenses_that_can_be_undone(model)
    assert all(list(camera.params) == [900.0, 512.0, 384.0, -0.05] for camera in model.cameras.values())
    assert all(np.array_equal(model.images[key].cam_from_world().matrix(), pose) for key, pose in poses.items())
