"""The sRGB curve, undone: one for renderings, conditions and files."""

import numpy as np

from r2sego_blender.core.colours import linear_from_srgb


def test_linear_colours_are_those_of_the_standard():
    srgb = np.array([0.0, 0.04045, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(linear_from_srgb(srgb), [0.0, 0.0031308, 0.2140411, 1.0, 1.0], atol=1e-6)
