"""The models' own packages with random weights at their smallest, where they are installed: shapes and conventions.

An answer of random weights is refused everywhere but here.
"""

from __future__ import annotations

import importlib.util
import sys

import numpy as np
import pytest

from r2sego_blender.core.errors import NativeError
from r2sego_blender.geometry.estimators.backends import depth_estimator
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker, library_command
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.serving import RANDOM

SIZES = [(320, 240)] * 3
TOLD = {
    "depth-anything-3-small": {
        "intrinsics": np.tile([[400.0, 0, 252], [0, 400, 189], [0, 0, 1]], (3, 1, 1)),
        "camera_from_world": np.stack([np.eye(4) + np.eye(4, k=3) * x for x in (0.0, 0.4, 0.9)]),
    },
    "vggt": {},
    "moge-2": {"fov_x": np.full(3, 60.0)},
    "mast3r": {"pairs": np.array([[0, 1], [1, 2], [2, 0]])},
    "dust3r": {"pairs": np.array([[0, 1], [1, 2], [2, 0]])},
}
TOLD["depth-anything-3-small"]["camera_from_world"][2, 1, 3] = 0.7


@pytest.mark.slow
@pytest.mark.parametrize("name", TOLD)
def test_the_package_takes_its_pictures_as_they_are_and_answers_for_every_pixel(name):
    known = LEARNED_BACKENDS[name]
    if not any(importlib.util.find_spec(one) for one in known.modules):
        pytest.skip(f"{known.label} is not installed: no module {' or '.join(known.modules)}")
    estimator = depth_estimator(name, backend=name)
    places = estimator.placements(SIZES)
    pictures = np.random.default_rng(1).integers(0, 255, (3, places[0].height, places[0].width, 3), np.uint8)
    request = Request("depth", name, {"random_weights": True}, {"pictures": pictures, **TOLD[name]})
    command = library_command(sys.executable, f"workers.models.{known.worker}")
    with ProgramWorker(command, known.label, known.cure) as worker:
        with ask(worker, request, allow_random=True) as response:
            assert response.weights == RANDOM
            seen = estimator.read(response, places)
        with pytest.raises(NativeError), ask(worker, request):
            pass
    assert [one.depth.shape for one in seen] == [pictures.shape[1:3]] * 3
    for one in seen:
        assert one.confidence is None or (one.confidence >= 1.0).all()
