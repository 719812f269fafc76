"""MapAnything (Keetha et al., 2025): metric depth of photographs with their lenses and poses.

Read: github.com/facebookresearch/map-anything at f7ebafb4d8349776705aaa686cf928988d1bd7f4 (package mapanything
1.1). Code and the weights map-anything-apache are under Apache-2.0; map-anything is CC BY-NC 4.0 and not asked for.

In: pictures of one size of its table for 518 pixels, the nearest by aspect; as its ``preprocess_inputs`` does,
the photograph is scaled to cover it and cropped about the middle. With them intrinsics in pixels whose centres
are at integers, half a pixel less than here, and ``camera_poses``, world from camera in OpenCV axes, metres.
Out: ``depth_z``, planar, metres, in the order given, 0 where its mask leaves out sky and edges; confidence of at
least 1; intrinsics and ``camera_poses``, as those that go in, in the frame of the first picture's camera.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from .learned import MAP, LearnedEstimator, Seen, camera_found
from .placement import Placement

BACKENDS = {"mapanything": "MapAnything"}
ORDER = 2

_PICTURES = {
    1.000: (518, 518),
    1.321: (518, 392),
    1.542: (518, 336),
    1.762: (518, 294),
    2.056: (518, 252),
    3.083: (518, 168),
    0.757: (392, 518),
    0.649: (336, 518),
    0.567: (294, 518),
    0.486: (252, 518),
}  # by the aspect that stands for them
_HALF_PIXEL = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])


class Estimator(LearnedEstimator):
    """See ``LearnedEstimator``."""

    answers: ClassVar[Mapping[str, tuple[int | None, ...]]] = {
        "depth_z": MAP,
        "confidence": MAP,
        "intrinsics": (3, 3),
        "camera_poses": (4, 4),
    }

    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """Each by its own aspect: those of one shape are asked for together."""
        return [_placement(width, height) for width, height in sizes]

    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """``intrinsics`` (n, 3, 3) and ``camera_poses`` (n, 4, 4) float64."""
        matrices = [place.matrix(one.camera) for one, place in zip(captures, placements, strict=True)]
        return {
            "intrinsics": np.stack(matrices) - _HALF_PIXEL,
            "camera_poses": np.stack([one.camera.world_from_camera for one in captures]),
        }

    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """See ``LearnedEstimator``."""
        matrices, poses = said["intrinsics"] + _HALF_PIXEL, said["camera_poses"]
        return [
            Seen(said["depth_z"][k], said["confidence"][k], camera_found(matrices[k], poses[k], place))
            for k, place in enumerate(placements)
        ]


def _placement(width: int, height: int) -> Placement:
    aspect = width / height
    across, down = _PICTURES[min(_PICTURES, key=lambda known: abs(known - aspect))]
    scale = max(across / width, down / height) + 1e-8
    covers = math.floor(width * scale), math.floor(height * scale)
    return Placement(across, down, *covers, -((covers[0] - across) // 2), -((covers[1] - down) // 2))
