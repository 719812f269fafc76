"""Reading images: what phones and programs write, and what is no good."""

import struct
import subprocess
import sys

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from r2sego_blender.captures.poses.photographs import photograph_size, upright_size
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import (
    image_files,
    load_image,
    load_image_uint8,
    resize,
    resize_nearest,
    save_image,
    to_uint8,
)


@pytest.mark.parametrize("read", [load_image, photograph_size])
def test_an_image_of_too_many_pixels_is_named(tmp_path, monkeypatch, read):
    """Pillow refuses such images with an error of its own family."""
    Image.new("RGB", (64, 48)).save(tmp_path / "vast.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(CaptureError, match=r"vast\.png: .* more pixels than is sensible") as caught:
        read(tmp_path / "vast.png")
    assert caught.value.cure == "Scale it down."


def test_what_is_transparent_is_seen_over_black(tmp_path):
    """As splats are, whatever colour lies under it."""
    pixels = np.full((2, 2, 4), 200, np.uint8)
    pixels[0, :, 3], pixels[1, 0, 3], pixels[1, 1, 3] = 0, 128, 255
    Image.fromarray(pixels).save(tmp_path / "cut.png")
    np.testing.assert_allclose(load_image_uint8(tmp_path / "cut.png")[..., 1], [[0, 0], [100, 200]], atol=1)
    Image.fromarray(pixels).convert("LA").save(tmp_path / "grey.png")
    assert load_image_uint8(tmp_path / "grey.png")[0].max() == 0


def _colourful(width=40, height=24):
    """A picture whose corners differ, with smooth colours that JPEG keeps."""
    y, x = np.mgrid[:height, :width] / [[[height]], [[width]]]
    return (np.stack([x, y, 1.0 - x], axis=2) * 200 + 20).astype(np.uint8)


def _write_heic(path, picture, **kept):
    """Without loss, as HEIC can be."""
    Image.fromarray(picture).save(path, "HEIF", quality=-1, chroma=444, matrix_coefficients=0, **kept)


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif", "tif", "heic"])
@pytest.mark.parametrize("orientation", [1, 2, 3, 4, 5, 6, 7, 8])
def test_the_upright_size_is_that_of_the_loaded_image(tmp_path, suffix, orientation):
    path = tmp_path / f"turned.{suffix}"
    exif = Image.Exif()
    exif[274] = orientation
    kept = {"tiffinfo": {274: orientation}} if suffix == "tif" else {"exif": exif.tobytes()}
    Image.fromarray(_colourful()).save(path, **kept)
    height, width = load_image(path).shape[:2]
    assert upright_size(path) == (width, height) == ((24, 40) if orientation > 4 else (40, 24))
    assert photograph_size(path)[:2] == (40, 24)


@pytest.mark.parametrize("orientation", [1, 2, 3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("name", ["IMG_1.HEIC", "IMG_1.heif", "renamed.jpg"])
def test_an_iphones_photograph_is_the_same_picture_turned_once(tmp_path, name, orientation):
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(_colourful()).save(tmp_path / "same.png", exif=exif)
    _write_heic(tmp_path / name, _colourful(), exif=exif.tobytes())
    np.testing.assert_array_equal(load_image_uint8(tmp_path / name), load_image_uint8(tmp_path / "same.png"))
    assert photograph_size(tmp_path / name) == photograph_size(tmp_path / "same.png")


def test_an_avif_of_the_brand_that_heic_has_too_is_read(tmp_path):
    path = tmp_path / "a.avif"
    Image.fromarray(_colourful()).save(path)
    whole = path.read_bytes()
    assert whole[4:12] == b"ftypavif"
    path.write_bytes(whole[:8] + b"mif1" + whole[12:])
    assert load_image_uint8(path).shape == (24, 40, 3)


def test_heic_without_its_package_is_refused_with_the_cure(tmp_path):
    """As in an engine of before HEIC was read; other images are read there, also under HEIC's name."""
    _write_heic(tmp_path / "a.heic", _colourful())
    Image.fromarray(_colourful()).save(tmp_path / "b.heic", "JPEG")
    program = (
        "import sys; sys.modules['pillow_heif'] = None\n"
        "from pathlib import Path\n"
        "from r2sego_blender.captures.poses.photographs import photograph_size\n"
        "from r2sego_blender.core.errors import CaptureError\n"
        "from r2sego_blender.core.images import load_image\n"
        "for read in (load_image, photograph_size):\n"
        "    read(Path(sys.argv[2]))\n"
        "    try: read(Path(sys.argv[1]))\n"
        "    except CaptureError as error: print(error)\n"
    )
    paths = [str(tmp_path / name) for name in ("a.heic", "b.heic")]
    done = subprocess.run([sys.executable, "-c", program, *paths], capture_output=True, text=True, check=True)
    assert len(done.stdout.splitlines()) == 2
    for line in done.stdout.splitlines():
        assert line.startswith(f"{paths[0]}: HEIC cannot be read without the package pillow-heif. ")
        assert "Set Up Engine" in line and "pip install pillow-heif" in line


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_grey_images_of_16_bits_keep_their_brightness(tmp_path, suffix):
    grey = _colourful()[..., 0]
    cv2.imwrite(str(tmp_path / f"grey.{suffix}"), grey.astype(np.uint16) * 257)
    read = load_image_uint8(tmp_path / f"grey.{suffix}")
    np.testing.assert_array_equal(read, np.repeat(grey[..., None], 3, axis=2))


@pytest.mark.parametrize("kind", [np.float32, np.int32])
def test_an_image_of_32_bits_is_refused_and_not_taken_for_black_or_white(tmp_path, kind):
    file = tmp_path / "photo.tif"
    Image.fromarray(np.array([[0.2, 0.8]] if kind is np.float32 else [[10**8, 2 * 10**9]], kind)).save(file)
    with pytest.raises(CaptureError, match=r"photo\.tif: .*32 bits.* 8 or 16 bits"):
        load_image(file)


def test_colours_of_another_profile_become_srgb(tmp_path):
    """As with a phone's Display P3: here of a profile that calls sRGB's red green and the other way."""
    picture = _colourful()
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    # Another description, or it counts as sRGB itself.
    swapped = profile.replace(b"rXYZ", b"????").replace(b"gXYZ", b"rXYZ").replace(b"????", b"gXYZ")
    swapped = swapped.replace("sRGB".encode("utf-16-be"), "mine".encode("utf-16-be"))
    Image.fromarray(picture).save(tmp_path / "swapped.png", icc_profile=swapped)
    _write_heic(tmp_path / "swapped.heic", picture, icc_profile=swapped)
    for name in ("swapped.png", "swapped.heic"):
        read = load_image_uint8(tmp_path / name).astype(int)
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


def test_a_heic_beside_the_same_photograph_of_another_kind_is_none(tmp_path):
    for name in ("IMG_1.HEIC", "img_1.jpg", "IMG_2.heic", "IMG_3.png"):
        (tmp_path / name).write_bytes(b"")
    assert [path.name for path in image_files(tmp_path)] == ["IMG_2.heic", "IMG_3.png", "img_1.jpg"]


def _planar_tiff(planes, photometric):
    """A TIFF of (C, H, W) uint8 or uint16 values whose planes lie one after another, as Pillow writes none."""
    count, height, width = planes.shape
    inline, beyond, entries = 8 + 2 + 12 * 8 + 4, b"", b""
    pixels = inline + 10 * count  # behind the numbers that do not fit into their entries
    size = planes.nbytes // count
    tags = ((256, "I", [width]), (257, "I", [height]), (258, "H", [planes.itemsize * 8] * count))
    tags += ((262, "H", [photometric]), (273, "I", [pixels + size * n for n in range(count)]), (277, "H", [count]))
    tags += ((279, "I", [size] * count), (284, "H", [min(count, 2)]))
    for tag, kind, values in tags:
        raw = struct.pack(f"<{len(values)}{kind}", *values)
        where = raw.ljust(4, b"\0") if len(raw) <= 4 else struct.pack("<I", inline + len(beyond))
        beyond += raw if len(raw) > 4 else b""
        entries += struct.pack("<HHI", tag, 3 if kind == "H" else 4, len(values)) + where
    content = b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4) + beyond
    return content.ljust(pixels, b"\0") + planes.tobytes()


@pytest.mark.parametrize("bits", [8, 16])
def test_a_tiff_whose_white_is_zero_is_no_negative(tmp_path, bits):
    """Scanners write such greys."""
    stored = np.array([[[0, 64, 255]]]).astype(f"u{bits // 8}") * (257 if bits == 16 else 1)
    (tmp_path / "scan.tif").write_bytes(_planar_tiff(stored, photometric=0))
    np.testing.assert_array_equal(load_image_uint8(tmp_path / "scan.tif")[0, :, 0], [255, 191, 0])


def test_a_tiff_of_planes_is_right_or_refused(tmp_path):
    """Pillow takes the bytes of 16-bit ones for those of 8-bit ones."""
    planes = np.random.default_rng(0).integers(0, 255, (3, 4, 5))
    (tmp_path / "photo.tif").write_bytes(_planar_tiff(planes.astype(np.uint8), photometric=2))
    np.testing.assert_array_equal(load_image_uint8(tmp_path / "photo.tif"), np.moveaxis(planes, 0, -1))
    (tmp_path / "photo.tif").write_bytes(_planar_tiff(planes.astype(np.uint16) * 257, photometric=2))
    with pytest.raises(CaptureError, match=r"photo\.tif: .*16 bits.*interleaved"):
        load_image_uint8(tmp_path / "photo.tif")


@pytest.mark.parametrize("read", [load_image, photograph_size])
@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif", "tif", "heic"])
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


def test_a_heic_that_is_cut_short_or_garbled_is_named(tmp_path):
    path = tmp_path / "IMG_1.HEIC"
    _write_heic(path, _colourful())
    whole = path.read_bytes()
    pixels = whole.index(b"mdat") + 4
    too_long = whole[:pixels] + b"\x00\xff\xff\xff" + whole[pixels + 4 :]  # more than there is to read
    for damaged in (b"", whole[:20], whole[: len(whole) // 2], whole[:-1], too_long):
        path.write_bytes(damaged)
        with pytest.raises(CaptureError, match=r"IMG_1\.HEIC: the image cannot be read\. Replace the file"):
            load_image(path)


def test_values_are_rounded_to_the_nearest_of_256_and_clipped():
    values = np.array([-1.0, 0.0, 0.49 / 255, 0.51 / 255, 127.49 / 255, 127.51 / 255, 1.0, 7.0])
    assert to_uint8(values).tolist() == [0, 0, 0, 1, 127, 128, 255, 255]
    every = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(to_uint8(every.astype(np.float32) / 255.0), every)


def test_what_is_saved_is_loaded(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (7, 5, 3)).astype(np.uint8)
    for image in (pixels, pixels.astype(np.float32) / 255.0):
        save_image(tmp_path / "image.png", image)
        np.testing.assert_array_equal(load_image_uint8(tmp_path / "image.png"), pixels)
        np.testing.assert_array_equal(load_image(tmp_path / "image.png"), pixels.astype(np.float32) / 255.0)
    save_image(tmp_path / "grey.png", pixels[..., 0])
    np.testing.assert_array_equal(load_image_uint8(tmp_path / "grey.png"), pixels[..., :1].repeat(3, axis=2))


def test_smaller_is_the_mean_and_the_nearest_is_never_mixed():
    image = np.random.default_rng(1).random((6, 8, 3)).astype(np.float32)
    halves = image.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(resize(image, 4, 3), halves, atol=1e-6)
    assert resize(image, 8, 6) is image
    ids = np.array([[3.0, 7.0]], np.float32)
    assert resize_nearest(ids, 2, 4).tolist() == [[3.0, 3.0, 7.0, 7.0]] * 2


@pytest.mark.parametrize("width", [13, 20, 27, 40])
def test_the_nearest_pixel_is_where_the_centre_lies(width):
    """A ramp of pixel centres keeps its values to half a pixel, and on the mean."""
    ramp = np.tile(np.arange(16) + 0.5, (4, 1))
    moved = resize_nearest(ramp, 5, width)[0] - (np.arange(width) + 0.5) * 16.0 / width
    assert np.abs(moved).max() <= 0.5
    assert abs(moved.mean()) <= 0.1


def test_a_picture_of_a_palette_that_it_lacks_is_refused(tmp_path):
    path = tmp_path / "image.png"
    Image.new("P", (4, 3)).save(path)
    with_palette = path.read_bytes()
    begin = with_palette.index(b"PLTE") - 4
    size = int.from_bytes(with_palette[begin : begin + 4], "big")
    path.write_bytes(with_palette[:begin] + with_palette[begin + size + 12 :])
    with pytest.raises(CaptureError, match=r"image\.png"):
        load_image(path)
