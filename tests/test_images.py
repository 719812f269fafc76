"""Reading images: what phones and programs write, and what is no good."""

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from r2sego_blender.captures.photographs import photograph_size, upright_size
from r2sego_blender.errors import CaptureError
from r2sego_blender.images import image_files, load_image, load_image_uint8


@pytest.mark.parametrize("read", [load_image, photograph_size])
def test_an_image_of_too_many_pixels_is_named(tmp_path, monkeypatch, read):
    """Pillow refuses such images with an error of its own family."""
    Image.new("RGB", (64, 48)).save(tmp_path / "vast.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(CaptureError, match=r"vast\.png: .* more pixels than is sensible") as caught:
        read(tmp_path / "vast.png")
    assert caught.value.cure == "Scale it down."


def _colourful(width=40, height=24):
    """A picture whose corners differ, with smooth colours that JPEG keeps."""
    y, x = np.mgrid[:height, :width] / [[[height]], [[width]]]
    return (np.stack([x, y, 1.0 - x], axis=2) * 200 + 20).astype(np.uint8)


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif", "tif"])
@pytest.mark.parametrize("orientation", [1, 2, 3, 4, 5, 6, 7, 8])
def test_the_upright_size_is_that_of_the_loaded_image(tmp_path, suffix, orientation):
    path = tmp_path / f"turned.{suffix}"
    exif = Image.Exif()
    exif[274] = orientation
    kept = {"tiffinfo": {274: orientation}} if suffix == "tif" else {"exif": exif}
    Image.fromarray(_colourful()).save(path, **kept)
    height, width = load_image(path).shape[:2]
    assert upright_size(path) == (width, height) == ((24, 40) if orientation > 4 else (40, 24))
    assert photograph_size(path)[:2] == (40, 24)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_grey_images_of_16_bits_keep_their_brightness(tmp_path, suffix):
    grey = _colourful()[..., 0]
    cv2.imwrite(str(tmp_path / f"grey.{suffix}"), grey.astype(np.uint16) * 257)
    read = load_image_uint8(tmp_path / f"grey.{suffix}")
    np.testing.assert_array_equal(read, np.repeat(grey[..., None], 3, axis=2))


def test_colours_of_another_profile_become_srgb(tmp_path):
    """As with a phone's Display P3: here of a profile that calls sRGB's red green and the other way."""
    picture = _colourful()
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    # Another description, or it counts as sRGB itself.
    swapped = profile.replace(b"rXYZ", b"????").replace(b"gXYZ", b"rXYZ").replace(b"????", b"gXYZ")
    swapped = swapped.replace("sRGB".encode("utf-16-be"), "mine".encode("utf-16-be"))
    Image.fromarray(picture).save(tmp_path / "swapped.png", icc_profile=swapped)
    read = load_image_uint8(tmp_path / "swapped.png").astype(int)
    assert np.abs(read - picture[..., [1, 0, 2]]).max() <= 2
    Image.fromarray(picture).save(tmp_path / "same.png", icc_profile=profile)
    np.testing.assert_array_equal(load_image_uint8(tmp_path / "same.png"), picture)
    Image.fromarray(picture).save(tmp_path / "damaged.png", icc_profile=profile[:40])
    np.testing.assert_array_equal(load_image_uint8(tmp_path / "damaged.png"), picture)


def test_hidden_files_are_no_photographs(tmp_path):
    Image.fromarray(_colourful()).save(tmp_path / "IMG_1.JPG")
    (tmp_path / "._IMG_1.JPG").write_bytes(b"\x00\x05\x16\x07")
    (tmp_path / "folder.png").mkdir()
    assert image_files(tmp_path) == [tmp_path / "IMG_1.JPG"]


@pytest.mark.parametrize("read", [load_image, photograph_size])
@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif", "tif"])
def test_damaged_images_are_refused_or_read(tmp_path, suffix, read):
    """Whatever byte is wrong: every format of Pillow has errors of its own."""
    path, rng = tmp_path / f"damaged.{suffix}", np.random.default_rng(3)
    Image.fromarray(_colourful()).save(path)
    whole, refused = path.read_bytes(), 0
    for _ in range(120):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 4):
            damaged[place] = rng.integers(0, 256)
        path.write_bytes(damaged)
        try:
            read(path)
        except CaptureError as error:
            refused += error.where == str(path)
    assert refused > 0
