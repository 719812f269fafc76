"""Reading images that are no good."""

import pytest
from PIL import Image

from r2sego_blender.captures.photographs import photograph_size
from r2sego_blender.errors import CaptureError
from r2sego_blender.images import load_image


@pytest.mark.parametrize("read", [load_image, photograph_size])
def test_an_image_of_too_many_pixels_is_named(tmp_path, monkeypatch, read):
    """Pillow refuses such images with an error of its own family."""
    Image.new("RGB", (64, 48)).save(tmp_path / "vast.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(CaptureError, match=r"vast\.png: .* more pixels than is sensible") as caught:
        read(tmp_path / "vast.png")
    assert caught.value.cure == "Scale it down."
