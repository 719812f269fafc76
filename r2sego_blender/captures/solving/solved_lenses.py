"""Solved lenses whose distortion cannot be undone, found before a model is used, and made plain."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.errors import CaptureError
from ..colmap import load_pycolmap
from ..poses.colmap_model import camera_to_json, lens_from_json


def with_lenses_that_can_be_undone(model: Any) -> Any:
    """A pycolmap model, adjusted anew with pinholes where its lenses distort beyond what can be undone.

    Few photographs, or ones whose features lie in the middle, leave a radial term open: it then folds the
    corners over, and no photograph could be straightened. Runs in a child process.
    """
    pycolmap = load_pycolmap()
    folded = [camera for camera in model.cameras.values() if not can_be_undone(camera)]
    if folded:
        for camera in folded:
            used = {*camera.focal_length_idxs(), *camera.principal_point_idxs()}
            camera.params = [value if index in used else 0.0 for index, value in enumerate(camera.params)]
        options = pycolmap.BundleAdjustmentOptions(refine_extra_params=False, print_summary=False)
        pycolmap.bundle_adjustment(model, options)
        model.update_point_3d_errors()
    return model


def can_be_undone(camera: Any) -> bool:
    """Whether a photograph through a pycolmap camera could be straightened."""
    try:
        lens_from_json(camera_to_json(camera), "camera").straight(np.eye(4))
    except (CaptureError, ValueError):
        return False
    return True
