from __future__ import annotations

import pytest

from r2sego_blender.core.files_beside import file_beside


@pytest.mark.parametrize("name", ["a.bin", "./a.bin", "below/a.bin", "below/./a.bin", "not there.bin", "..."])
def test_a_file_beside_or_below_is_found(tmp_path, name):
    (tmp_path / "below").mkdir()
    assert file_beside(tmp_path / "scene.gltf", name).is_relative_to(tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        "",
        "/a.bin",
        "../a.bin",
        "below/../../a.bin",
        "below/..",
        "C:a.bin",
        "file:a",
        "..\\a.bin",
        "a\0",
        "`a`",
        "link/a",
    ],
)
def test_a_file_elsewhere_is_refused(tmp_path, name):
    (tmp_path / "inside" / "below").mkdir(parents=True)
    (tmp_path / "inside" / "link").symlink_to(tmp_path)
    with pytest.raises(ValueError, match=r"file|nowhere"):
        file_beside(tmp_path / "inside" / "scene.gltf", name)


def test_a_link_within_the_folder_is_followed_and_one_to_itself_is_not(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"1")
    (tmp_path / "b.bin").symlink_to("a.bin")
    assert file_beside(tmp_path / "scene.gltf", "b.bin").read_bytes() == b"1"
    (tmp_path / "ring").symlink_to("ring")
    try:
        found = file_beside(tmp_path / "scene.gltf", "ring")
    except ValueError:
        return
    with pytest.raises(OSError, match="ring"):
        found.read_bytes()
