"""An image may be as large as its bytes account for: a phone's photograph is read, a bomb is not."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from r2sego_blender.captures.poses.photographs import photograph_size
from r2sego_blender.core.errors import CaptureError, SceneError
from r2sego_blender.core.image_sizes import require_sensible_png, require_sensible_size
from r2sego_blender.core.images import load_image, load_image_uint8, stored_values
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb

PHONE = 16320, 12240


def black_png(file: Path, width: int, height: int, bits: int = 8, colours: int = 0) -> Path:
    """A PNG of nothing but zeros, as small as one can be."""
    channels = {0: 1, 2: 3, 6: 4}[colours]
    packer = zlib.compressobj(9)
    rows = b"".join(packer.compress(bytes(1 + width * channels * bits // 8)) for _ in range(height)) + packer.flush()
    header = struct.pack(">IIBBBBB", width, height, bits, colours, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", rows), (b"IEND", b""))
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks))
    return file


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


@pytest.mark.parametrize(("file_bytes", "size"), [(25_000_000, PHONE), (6_000_000, PHONE), (1000, (8000, 6000))])
def test_photographs_of_phones_are_sensible(file_bytes, size):
    require_sensible_size(Path("IMG.jpg"), *size, file_bytes)


@pytest.mark.parametrize(
    ("file_bytes", "size"), [(500_000, (13_000, 13_000)), (10**9, (20_000, 20_000)), (2 << 30, (100, 100))]
)
def test_bombs_are_not(file_bytes, size):
    with pytest.raises(CaptureError, match=r"IMG\.jpg: .* more pixels than is sensible"):
        require_sensible_size(Path("IMG.jpg"), *size, file_bytes)


@pytest.mark.parametrize("read", [photograph_size, load_image, load_image_uint8, stored_values])
@pytest.mark.parametrize(("width", "height", "bits", "colours"), [(9000, 9000, 8, 2), (30_000, 3000, 16, 0)])
def test_a_bomb_takes_no_memory(tmp_path, read, width, height, bits, colours):
    file = black_png(tmp_path / "bomb.png", width, height, bits, colours)
    forget_peak_memory()
    before_mb = peak_memory_mb()
    with pytest.raises(CaptureError, match=r"bomb\.png: .* more pixels than is sensible"):
        read(file)
    assert before_mb is None or peak_memory_mb() - before_mb < 50.0


@pytest.mark.parametrize("kind", [b"tEXt", b"eXIf", b"fcTL", b"IDAT"])
def test_a_chunk_that_says_it_is_longer_than_its_file_is_no_image(tmp_path, kind):
    """OpenCV takes as much memory as the chunk says."""
    file = black_png(tmp_path / "depth.png", 32, 24, 16)
    whole = file.read_bytes()
    place = whole.index(b"IDAT") - 4
    file.write_bytes(whole[:place] + struct.pack(">I", 1 << 30) + kind + whole[place + 8 :])
    forget_peak_memory()
    before_mb = peak_memory_mb()
    assert stored_values(file) is None
    assert before_mb is None or peak_memory_mb() - before_mb < 50.0


def test_what_follows_the_end_of_a_picture_is_none_of_it(tmp_path):
    """OpenCV goes on to read where there were no pixels before the end, and takes the memory it finds asked for."""
    file = black_png(tmp_path / "depth.png", 32, 24, 16)
    whole = file.read_bytes()
    vast = struct.pack(">I", 0x7FFFFFF0) + b"IDAT"
    file.write_bytes(whole + vast)
    np.testing.assert_array_equal(stored_values(file), np.zeros((24, 32), np.uint16))
    place = whole.index(b"IDAT") - 4
    file.write_bytes(whole[:place] + whole[whole.index(b"IEND") - 4 :] + 60 * vast)
    forget_peak_memory()
    before_mb = peak_memory_mb()
    assert stored_values(file) is None
    assert before_mb is None or peak_memory_mb() - before_mb < 50.0


def test_of_an_animation_the_picture_is_read_and_a_damaged_one_ends_nothing(tmp_path):
    """OpenCV 4.11 dies of it, so this is tried in a process of its own."""
    file, rng = tmp_path / "moving.png", np.random.default_rng(0)
    frames = [Image.fromarray(rng.integers(0, 255, (24, 32), np.uint8)) for _ in range(3)]
    frames[0].save(file, save_all=True, append_images=frames[1:])
    np.testing.assert_array_equal(stored_values(file), np.asarray(frames[0]))
    ask = "import sys; from pathlib import Path; from r2sego_blender.core.images import stored_values"
    ask += "; print(stored_values(Path(sys.argv[1])) is None)"
    for filter_type in (9, 255):  # there are five
        rows = b"".join(bytes([filter_type]) + bytes(4) for _ in range(4000))
        chunks = [(b"IHDR", struct.pack(">IIBBBBB", 32, 4000, 1, 0, 0, 0, 0)), (b"acTL", struct.pack(">II", 2, 0))]
        chunks += [(b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
        file.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks))
        found = subprocess.run([sys.executable, "-c", ask, str(file)], capture_output=True, text=True, check=False)
        assert (found.returncode, found.stdout) == (0, "True\n")


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_values_are_read_as_they_are_stored(tmp_path, kind, channels, suffix):
    if (suffix, kind) == ("png", np.float32):
        pytest.skip("PNG has none of these")
    values = (np.random.default_rng(2).random((24, 32, channels)) * 200).astype(kind)
    file = tmp_path / f"values.{suffix}"
    # Of colours in floats OpenCV keeps a logarithm, unless told otherwise.
    cv2.imwrite(str(file), values, [cv2.IMWRITE_TIFF_COMPRESSION, 1] if suffix == "tif" else [])
    read = stored_values(file)
    assert read.dtype == kind
    np.testing.assert_array_equal(read.reshape(values.shape), values)


@pytest.mark.parametrize(
    "content", [b"", b"II*\0\xff\xff\xff\xff", b"MM\0*", b"\x89PNG\r\n\x1a\n", b"%!PS-Adobe-3.0 EPSF-3.0\n"]
)
def test_what_is_no_image_has_no_values(tmp_path, content):
    (tmp_path / "x.png").write_bytes(content)
    assert stored_values(tmp_path / "x.png") is None
    with pytest.raises(CaptureError, match=r"x\.png: the image cannot be read"):
        load_image(tmp_path / "x.png")


def test_no_program_is_started_for_a_picture_of_another_kind(tmp_path, monkeypatch):
    """Pillow runs Ghostscript for EPS, whatever the file is called."""
    Image.new("RGB", (8, 8)).save(tmp_path / "a.eps")
    (tmp_path / "a.eps").rename(tmp_path / "a.png")
    monkeypatch.setattr("subprocess.Popen", None)
    with pytest.raises(CaptureError, match=r"a\.png: the image cannot be read"):
        load_image(tmp_path / "a.png")


def test_a_bundles_pictures_are_looked_at_before_blender_loads_them(tmp_path):
    require_sensible_png(black_png(tmp_path / "sound.png", 64, 48), SceneError)
    black_png(tmp_path / "bomb.png", 9000, 9000)
    Image.new("RGB", (64, 48)).save(tmp_path / "other.png", "JPEG")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("bomb.png", "other.png", "empty.png", "missing.png"):
        with pytest.raises(SceneError, match=name):
            require_sensible_png(tmp_path / name, SceneError)
