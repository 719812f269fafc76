"""Pictures side by side, with words drawn above them."""

import numpy as np
import pytest

from r2sego_blender.results.panels.view_grid import (
    coloured_provenance,
    depth_range_m,
    fitted,
    shaded_depth,
    side_by_side,
)
from r2sego_blender.results.panels.view_labels import draw_text, text_mask


def test_letters_are_drawn_as_they_look():
    rows = ["".join("#" if bit else " " for bit in row) for row in text_mask("E1", 1)]
    assert rows == ["#####   #   ", "#      ##   ", "####    #   ", "#       #   ", "#####  ###  "]
    assert text_mask("ab", 3).shape == (15, 36)
    np.testing.assert_array_equal(text_mask("ä", 1), text_mask("?", 1))
    assert text_mask("", 2).shape == (10, 0)


def test_letters_differ():
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.,:-_/()%+=?"
    assert len({text_mask(letter, 1).tobytes() for letter in letters}) == len(letters)


def test_words_that_do_not_fit_are_cut_off():
    image = np.zeros((8, 10, 3), np.uint8)
    draw_text(image, "HELLO", 3, 2, 1, 200)
    assert (image[2, [3, 7]] == 200).all() and (image[:, :3] == 0).all()
    draw_text(image, "HELLO", 99, 99, 1, 200)


def test_a_picture_keeps_its_proportions():
    picture = np.full((20, 10, 3), 9, np.uint8)
    framed = fitted(picture, (40, 60))
    assert framed.shape == (40, 60, 3)
    seen = framed[..., 0] == 9
    assert seen.sum() == 40 * 20 and seen[:, 20:40].all()


def test_a_picture_is_not_mirrored_or_mixed():
    picture = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    np.testing.assert_array_equal(fitted(picture, (4, 6)), picture)
    np.testing.assert_array_equal(fitted(picture, (8, 12))[::2, ::2], picture)


def test_every_picture_has_its_cell():
    pictures = [(f"part {value}", np.full((30, 40, 3), value, np.uint8)) for value in (10, 60, 110, 160, 210)]
    grid = side_by_side(pictures, (30, 40))
    for _, picture in pictures:
        assert (grid == picture[0, 0, 0]).all(axis=-1).sum() == 30 * 40
    firsts = [np.argwhere((grid == value).all(axis=-1))[0] for value in (10, 60, 110, 160, 210)]
    assert firsts[0][0] == firsts[1][0] < firsts[3][0]
    assert firsts[0][1] < firsts[1][1] < firsts[2][1]
    assert side_by_side(pictures, (30, 40), columns=1).shape[0] > grid.shape[0]
    with pytest.raises(ValueError, match="no picture"):
        side_by_side([], (30, 40))


def test_depth_is_light_near_and_black_where_there_is_none():
    levels = np.array([[0.0, 0.1], [0.2, 0.3]])
    shaded = shaded_depth(levels)[..., 0]
    assert shaded[0, 0] == 0 and shaded[0, 1] == 255 > shaded[1, 0] > shaded[1, 1] > 0
    assert not shaded_depth(np.zeros((2, 2))).any()
    assert shaded_depth(np.full((2, 2), 0.5)).min() == 255
    assert depth_range_m(np.array([0.0, 1500 / 65535, 3000 / 65535])) == pytest.approx((1.5, 3.0))
    assert depth_range_m(np.zeros(3)) == (0.0, 0.0)


def test_provenance_has_the_papers_colours():
    colours = coloured_provenance(np.array([[0, 1, 2, 3]]))
    np.testing.assert_array_equal(colours[0, 0], 0)
    red, green, blue = colours[0, 2]
    assert green > red and blue > red  # teal
    assert len(np.unique(colours[0], axis=0)) == 4
