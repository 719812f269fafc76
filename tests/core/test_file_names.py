"""An object's name is a folder's on Linux, macOS and Windows."""

import pytest

from r2sego_blender.core.file_names import caseless, plain_name


@pytest.mark.parametrize(
    ("given", "plain"),
    [
        ("chair_02", "chair_02"),
        ("Big Chair: 1/2?", "Big_Chair__1_2"),
        ("table.", "table"),
        ("椅子", "object"),
        ("con", "object_con"),
        ("AUX.001", "object_AUX.001"),
        ("Lpt9", "object_Lpt9"),
        ("console", "console"),
    ],
)
def test_a_name_is_a_folders_on_every_system(given, plain):
    assert plain_name(given) == plain


@pytest.mark.parametrize("other", ["KÜCHE ẞ.JPG", "küche ß.jpg", "Ku\u0308che SS.jpg", "KU\u0308CHE \u017fs.jpg"])
def test_names_that_look_the_same_are_the_same_without_case(other):
    assert caseless("Küche ß.jpg") == caseless(other) != caseless("Kuche ss.jpg")
