"""An object's name is a folder's on Linux, macOS and Windows."""

import pytest

from r2sego_blender.core.file_names import plain_name


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
