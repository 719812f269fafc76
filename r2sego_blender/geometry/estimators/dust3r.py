"""DUSt3R (Wang et al., CVPR 2024) and MASt3R (Leroy et al., ECCV 2024): pointmaps of pairs of photographs.

Read: github.com/naver/mast3r at f5209afc300cec36239a7ac992263f36847bbba0 and github.com/naver/dust3r at
3cc8c88c413bb9e34c41db0e0eef99c2ee010b12, which it brings and whose network is that of
4c24a6ebf04809f2cfe59915e51779c8984aaa40; neither is a package. Code and weights are under CC BY-NC-SA 4.0, not for
commercial use, the weights also under the terms of what they were trained on.

In: pictures whose longer side is 512, as its ``load_images`` does cropped about the middle to multiples of 16, a
square one to 4 by 3; ``pairs`` (m, 2) of their indices, in which each photograph comes first with those beside it.
Lens and pose are not taken. Out: of each pair the pointmap of the first picture in the first picture's own camera
frame (OpenCV axes), whose z is planar depth, and its confidence of at least 1 (1 + exp). The pair that is surest
of a picture speaks for it. The unit is a pair's own; MASt3R's is about a metre. Its global alignment is not used:
between photographs that share little it bends what each pair knows, and the scale of each is found here anyway.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from .learned import MAP, LearnedEstimator, Seen
from .placement import Placement

BACKENDS = {"mast3r": "MASt3R", "dust3r": "DUSt3R"}
ORDER = 5

_LONGEST = 512
_PATCH = 16
_PARTNERS = 3


class Estimator(LearnedEstimator):
    """See ``LearnedEstimator``."""

    answers: ClassVar[Mapping[str, tuple[int | None, ...]]] = {"pts3d": (None, None, 3), "confidence": MAP}

    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """Each as its own shape says: those of one are paired with each other."""
        return [_placement(width, height) for width, height in sizes]

    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """``pairs`` (m, 2) int64."""
        return {"pairs": pairs_of(np.stack([one.camera.forward for one in captures]))}

    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """See ``LearnedEstimator``; each picture's are of the pair that was surest of it."""
        return [Seen(points[..., 2], sure) for points, sure in zip(said["pts3d"], said["confidence"], strict=True)]


def pairs_of(forward: np.ndarray) -> np.ndarray:
    """(m, 2) int64: each of the views (n, 3) first, with the few that look most nearly where it does.

    A view without any other is paired with itself, as DUSt3R's own demo does.
    """
    alike = forward @ forward.T
    np.fill_diagonal(alike, -np.inf)
    count = len(forward)
    if count == 1:
        return np.zeros((1, 2), np.int64)
    nearest = np.argsort(-alike, axis=1, kind="stable")[:, : min(_PARTNERS, count - 1)]
    return np.stack([np.repeat(np.arange(count), nearest.shape[1]), nearest.ravel()], axis=1)


def _placement(width: int, height: int) -> Placement:
    across, down = (round(side * _LONGEST / max(width, height)) for side in (width, height))
    middle = across // 2, down // 2
    half = [2 * one // _PATCH * _PATCH // 2 for one in middle]
    if across == down:
        half[1] = 3 * half[0] // 4
    return Placement(2 * half[0], 2 * half[1], across, down, half[0] - middle[0], half[1] - middle[1])
