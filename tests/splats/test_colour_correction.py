"""A picture in the colours of a photograph."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.splats.colour_correction import colour_corrected
from r2sego_blender.splats.metrics import psnr


def picture(seed, low=0.2, high=0.7):
    return np.random.default_rng(seed).uniform(low, high, (24, 32, 3))


def reference(image, wanted, iterations=5, nearly=0.5 / 255.0):
    """multinerf's ``color_correct``, written out as it stands: one least-squares problem a channel."""

    def inside(values):
        return (values >= nearly) & (values <= 1.0 - nearly)

    given_, target = image.reshape(-1, 3), wanted.reshape(-1, 3)
    colours = given_
    for _ in range(iterations):
        terms = [colours[:, c : c + 1] * colours[:, c:] for c in range(3)]
        terms = np.concatenate([*terms, colours, np.ones_like(colours[:, :1])], axis=1)
        factors = []
        for c in range(3):
            mask = inside(given_[:, c]) & inside(colours[:, c]) & inside(target[:, c])
            factors.append(np.linalg.lstsq(terms * mask[:, None], target[:, c] * mask, rcond=-1)[0])
        colours = np.clip(terms @ np.stack(factors, axis=1), 0.0, 1.0)
    return colours.reshape(image.shape)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.5, 1.3), st.floats(0.005, 0.1))
def test_it_is_that_of_multinerf(seed, gain, noise):
    rng = np.random.default_rng(seed)
    image = picture(seed, 0.0, 1.0)
    wanted = np.clip(gain * image + noise * rng.normal(size=image.shape), 0.0, 1.0)
    assert psnr(colour_corrected(image, wanted), wanted) == pytest.approx(
        psnr(reference(image, wanted), wanted), abs=1e-4
    )


@pytest.mark.parametrize("gains", [(0.6, 0.6, 0.6), (1.2, 1.0, 0.8)])
def test_an_exposure_and_a_white_balance_are_nothing_after_it(gains):
    image = picture(1)
    assert psnr(image, image * gains) < 30.0
    assert psnr(colour_corrected(image, image * gains), image * gains) > 80.0


def test_what_is_somewhere_else_stays_an_error():
    image = picture(2)
    moved = np.roll(image, 5, axis=1)
    assert psnr(colour_corrected(image, moved), moved) < psnr(image, moved) + 4.0


def test_a_black_picture_stays_as_it_is():
    black = np.zeros((8, 9, 3))
    np.testing.assert_array_equal(colour_corrected(black, picture(3)[:8, :9]), black)


def test_equal_pictures_stay_equal():
    image = picture(4)
    np.testing.assert_allclose(colour_corrected(image, image), image, atol=1e-9)
