"""Softening: what is sure stays, what is doubtful goes to the mean of what is sure around it."""

import numpy as np
from scipy.ndimage import gaussian_filter

from r2sego_blender.generation.generators.uncertainty import soften_uncertain


def picture(rng, shape=(48, 96)):
    return rng.random((*shape, 3)).astype(np.float32)


def test_it_is_its_plain_definition():
    rng = np.random.default_rng(4)
    image, confidence = picture(rng), rng.random((48, 96)).astype(np.float32)
    weight = confidence.astype(np.float64) + 1e-3
    # OpenCV's kernels are cut off sooner than these: the middle differs by their tails alone
    blurred = [gaussian_filter(image[..., c] * weight, 96 / 256, mode="mirror") for c in range(3)]
    mean = np.stack(blurred, axis=-1) / gaussian_filter(weight, 96 / 256, mode="mirror")[..., None]
    doubt = np.maximum(1.0 - confidence / 0.6, 0.0)[..., None]
    np.testing.assert_allclose(soften_uncertain(image, confidence), image + 0.9 * doubt * (mean - image), atol=2e-2)


def test_sure_pixels_stay_and_doubtful_ones_become_alike():
    rng = np.random.default_rng(5)
    image, confidence = picture(rng, (64, 640)), np.ones((64, 640), np.float32)
    assert soften_uncertain(image, confidence) is image
    confidence[:, 320:] = 0.1
    softened = soften_uncertain(image, confidence)
    np.testing.assert_array_equal(softened[:, :320], image[:, :320])
    assert softened[:, 340:].std() < 0.4 * image[:, 340:].std()
    assert abs(softened[:, 340:].mean() - image[:, 340:].mean()) < 0.01


def test_a_doubtful_pixel_takes_after_the_sure_ones_beside_it():
    image = np.zeros((32, 640, 3), np.float32)
    image[:, 320:] = 1.0
    confidence = np.where(np.arange(640) < 320, 1.0, 0.1).astype(np.float32)[None].repeat(32, 0)
    softened = soften_uncertain(image, confidence)[16, :, 0]
    assert softened[320] < 0.4 < 0.95 < softened[335]


def test_an_image_without_any_confidence_stays_finite():
    image = picture(np.random.default_rng(6))
    assert np.isfinite(soften_uncertain(image, np.zeros((48, 96), np.float32))).all()
