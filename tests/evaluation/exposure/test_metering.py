"""A camera that exposes by itself is foretold by what it looks at; any other by the captures near."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from small_bundle import HEIGHT, WIDTH, camera

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.evaluation.exposure.metering import Metering

METERED = 0.18
EIGHT_BITS = 0.02  # what rounding a photograph changes of a logarithm
XS = (-1.5, -0.5, 0.5, 1.5)


class Grey(Capture):
    """A capture of a single grey, without a file."""

    def as_taken(self):
        return np.full((HEIGHT, WIDTH, 3), srgb_from_linear(np.float32(self.weight)), np.float32)


def captures(rooms, taken, white=(1.0, 1.0, 1.0)):
    """Photographs of surfaces of linear grey ``rooms`` that came out as ``taken``."""
    return [
        Grey(str(x), None, camera(x), weight=grey, gain=tuple(np.array(white) * room / grey))
        for x, room, grey in zip(XS, rooms, taken, strict=True)
    ]


def sees(room, share=1.0):
    """A view of a surface of linear grey ``room``, of which captures saw a share."""
    known = np.zeros((HEIGHT, WIDTH), bool)
    known[:, : round(share * WIDTH)] = True
    picture = np.where(known[..., None], srgb_from_linear(np.float32(room)), np.float32(0.9)).repeat(3, axis=-1)
    return lambda of: (picture, known)


GREYS = st.floats(0.02, 0.4)


@given(st.lists(GREYS, min_size=4, max_size=4), GREYS, st.floats(-2.0, 2.0))
def test_a_camera_that_exposes_by_itself_is_foretold_wherever_it_stands(rooms, room, x):
    one = Metering(captures(rooms, [METERED] * 4), sees(room))
    if np.ptp(rooms) > 1e-3:
        np.testing.assert_allclose(one.log_exposure(camera(x)), np.log(METERED / room), atol=EIGHT_BITS)


@example([0.390625] * 4, 0.25)  # a room of one grey: there, any rule foretells the captures, but for rounding
@given(st.lists(GREYS, min_size=4, max_size=4), GREYS)
def test_a_camera_that_exposes_by_hand_is_that_of_the_captures_near(rooms, room):
    """One exposure for all, 1.5 times that of the room's unit: the dark is dark in the photographs, too."""
    made = captures(rooms, [1.5 * grey for grey in rooms])
    np.testing.assert_allclose(Metering(made, sees(room)).log_exposure(camera()), np.log(1.5), atol=1e-5)


@given(st.floats(0.1, 1.0))
def test_what_no_capture_saw_is_taken_for_as_bright_as_what_they_show(share):
    made = captures([0.05, 0.1, 0.2, 0.4], [METERED] * 4)
    near, metered = (Metering(made, seen).log_exposure(camera()) for seen in (None, sees(0.3, share)))
    wholly = Metering(made, sees(0.3)).log_exposure(camera())
    counted = round(share * WIDTH) / WIDTH
    np.testing.assert_allclose(metered, near + counted * (wholly - near), atol=1e-5)
    assert (Metering(made, sees(0.3, 0.0)).log_exposure(camera()) == near).all()


def test_the_white_balance_is_that_of_the_captures_near():
    white = np.array((0.8, 1.0, 1.3))
    one = Metering(captures([0.05, 0.1, 0.2, 0.4], [METERED] * 4, white), sees(0.3))
    found = one.log_exposure(camera())
    np.testing.assert_allclose(found - found[1], -np.log(white), atol=1e-5)


@pytest.mark.parametrize("count", [1, 2])
def test_of_two_captures_no_rule_is_learned(count):
    one = Metering(captures([0.05, 0.1, 0.2, 0.4], [METERED] * 4)[:count], sees(0.3))
    assert not one.meters
    assert (one.log_exposure(camera()) == Metering(one.captures).log_exposure(camera())).all()


def test_linear_light_is_what_is_metered():
    """Half a picture of 0.4 and half of 0.02 is as bright as one of 0.21, which the mean of sRGB values is not."""
    made = captures([0.05, 0.1, 0.2, 0.4], [METERED] * 4)
    picture = np.full((HEIGHT, WIDTH, 3), srgb_from_linear(np.float32(0.4)), np.float32)
    picture[:, WIDTH // 2 :] = srgb_from_linear(np.float32(0.02))
    known = np.ones((HEIGHT, WIDTH), bool)
    assert linear_from_srgb(picture).mean() == pytest.approx(0.21, abs=1e-4)
    found = Metering(made, lambda of: (picture, known)).log_exposure(camera())
    np.testing.assert_allclose(found, np.log(METERED / 0.21), atol=EIGHT_BITS)
