"""A picture in the colours of a photograph: what is left of its error is not exposure and not white balance.

As multinerf's ``color_correct`` (Barron et al., *Zip-NeRF*, ICCV 2023, where scores after it are called "cc"): each
channel becomes the quadratic polynomial of the picture's colours that comes nearest to the photograph's. It looks at
the photograph, so no score that is compared with others' is made of it.
"""

from __future__ import annotations

import numpy as np

_ITERATIONS = 5
_UNSATURATED = (0.5 / 255.0, 1.0 - 0.5 / 255.0)


def colour_corrected(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(H, W, 3) float64 in [0, 1]: ``image`` in the colours of ``reference``, both (H, W, 3) in [0, 1].

    Pixels where a channel is black or white, before or after, tell nothing of it. A channel of which nothing is left
    stays as it is.
    """
    given, wanted = (np.asarray(each, np.float64).reshape(-1, 3) for each in (image, reference))
    told = _unsaturated(given) & _unsaturated(wanted)
    colours = given
    for _ in range(_ITERATIONS):
        red, green, blue = colours.T
        powers = (red * red, red * green, red * blue, green * green, green * blue, blue * blue)
        terms = np.stack([*powers, red, green, blue, np.ones_like(red)], axis=1)
        counted = told & _unsaturated(colours)
        channels = []
        for channel in range(3):
            on = counted[:, channel]
            of_these = terms[on]
            factors = np.linalg.lstsq(of_these.T @ of_these, of_these.T @ wanted[on, channel], rcond=None)[0]
            channels.append(terms @ factors if on.any() else colours[:, channel])
        colours = np.clip(np.stack(channels, axis=1), 0.0, 1.0)
    return colours.reshape(image.shape)


def _unsaturated(colours: np.ndarray) -> np.ndarray:
    low, high = _UNSATURATED
    return (colours >= low) & (colours <= high)
