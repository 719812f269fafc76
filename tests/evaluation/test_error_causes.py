"""Errors find their cause: wrong depth before never seen, before edges, before appearance."""

import numpy as np

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.evaluation.error_causes import CAUSES, causes, split


def camera(x: float = 0.0) -> Camera:
    return Camera(80, 60, 60.0, 60.0, 40.0, 30.0, look_at((x, 0.0, 1.0), (x, 1.0, 1.0)))


def test_every_pixel_has_its_first_cause():
    """A wall two metres away, the left third of it a metre; the capture stands to the right."""
    true = np.full((60, 80), 2.0, np.float32)
    true[:, :27] = 1.0
    proxy = true.copy()
    proxy[:20] *= 1.1
    other = camera(0.5)
    other_true = np.full((60, 80), 2.0, np.float32)  # the wall reaches to its left border at x = -0.83
    labels = causes(camera(), proxy, true, [other], [other_true])
    assert (labels[:20] == CAUSES.index("wrong_depth")).all()
    assert (labels[20:, :24] == CAUSES.index("never_seen")).all()
    assert (labels[20:, 27:29] == CAUSES.index("edges")).all()
    assert (labels[20:, 32:] == CAUSES.index("appearance")).all()
    nobody = causes(camera(), true, true, [], [])
    assert (nobody == CAUSES.index("never_seen")).all()


def test_shares_sum_to_one_and_measure_their_own_pixels():
    rng = np.random.default_rng(0)
    truth = rng.random((30, 40, 3))
    image = truth.copy()
    labels = np.zeros((30, 40), np.uint8)
    labels[10:] = 3
    image[:10] += 0.2
    image[10:] += 0.1
    shares = split([image, image], [truth, truth], [labels, labels])
    assert sum(one.pixels for one in shares.values()) == 1.0
    np.testing.assert_allclose(sum(one.error for one in shares.values()), 1.0)
    np.testing.assert_allclose(shares["wrong_depth"].error, 0.04 / (0.04 + 2 * 0.01))
    np.testing.assert_allclose(shares["appearance"].psnr, 20.0)
    assert shares["edges"].psnr is None and shares["edges"].pixels == 0.0
