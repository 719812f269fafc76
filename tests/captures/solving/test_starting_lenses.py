"""The lenses that solving starts from, and those that it goes on with."""

from __future__ import annotations

import pytest
from PIL import Image

from r2sego_blender.captures.solving.starting_lenses import (
    FOCAL_GUESS,
    cameras_of_their_own,
    focal_of_exif,
    solved_cameras,
    starting_cameras,
)


@pytest.fixture
def photographs(tmp_path):
    """Three landscape photographs without EXIF, one of the same size with it, one in portrait."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    paths = [tmp_path / f"{index}.jpg" for index in range(5)]
    for index, path in enumerate(paths):
        size = (300, 400) if index == 4 else (400, 300)
        Image.new("RGB", size).save(path, **({"exif": exif.tobytes()} if index == 3 else {}))
    return [str(path) for path in paths], [(400, 300)] * 4 + [(300, 400)]


@pytest.mark.parametrize("suffix", ["webp", "avif", "heic", "jpg"])
def test_exif_is_read_of_formats_that_colmap_does_not_read(tmp_path, suffix):
    """28 mm of a film's 43.27 mm diagonal are 323.6 of 500 pixels."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    path = tmp_path / f"a.{suffix}"
    Image.new("RGB", (400, 300)).save(path, exif=exif.tobytes())
    assert focal_of_exif(str(path)) == pytest.approx(500.0 * 28.0 / 43.27 / 400.0, rel=1e-3)


def test_damaged_exif_tells_no_focal_length(tmp_path, blank_photograph):
    path = blank_photograph(tmp_path / "a.png")
    Image.open(path).save(tmp_path / "a.webp", exif=b"Exif\x00\x00MM\x00*\x00\x00\xff")
    assert focal_of_exif(str(path)) is None and focal_of_exif(str(tmp_path / "a.webp")) is None


def test_photographs_of_one_size_and_focal_length_start_from_one_camera(photographs):
    cameras, camera_of = starting_cameras(*photographs)
    assert camera_of == [0, 0, 0, 1, 2]
    assert [camera.has_prior_focal_length for camera in cameras] == [False, True, False]
    assert [camera.params[0] for camera in cameras] == pytest.approx(
        [400 * FOCAL_GUESS, 323.6, 400 * FOCAL_GUESS], rel=1e-3
    )
    own, own_of = cameras_of_their_own(cameras, camera_of)
    assert own_of == [0, 1, 2, 3, 4] and [camera.params[0] for camera in own[:2]] == [400 * FOCAL_GUESS] * 2


def test_a_photograph_without_a_solved_lens_has_that_of_one_that_started_like_it(photographs):
    cameras, camera_of = starting_cameras(*photographs)
    solved = {"focal": [310.0, 310.0, 200.0, 150.0], "extra": [0.02]}
    other = {"focal": [290.0, 290.0, 200.0, 150.0], "extra": [0.0]}
    found, of = solved_cameras(cameras, camera_of, [{"index": 1, "camera": solved}, {"index": 2, "camera": other}])
    lenses = [list(found[index].params) for index in of]
    assert lenses[:3] == [[310.0, 200.0, 150.0, 0.02]] * 2 + [[290.0, 200.0, 150.0, 0.0]]
    assert lenses[3:] == [list(cameras[1].params), list(cameras[2].params)]
    assert [found[index].has_prior_focal_length for index in of] == [True, True, True, True, False]
    assert [camera.params[0] for camera in cameras] == pytest.approx([340.0, 323.6, 340.0], rel=1e-3)
