from r2sego_blender.bridge.words import counted


def test_one_of_a_kind_is_singular():
    assert [counted(count, "mask") for count in (0, 1, 2)] == ["0 masks", "1 mask", "2 masks"]
