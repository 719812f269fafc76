"""Masks beside photographs: found by name, as the camera sees them, refused when of another shape."""

from pathlib import Path

import numpy as np
from expected_errors import refused

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.captures.masks import counted_pixels, with_masks_beside
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

CAMERA = Camera(32, 24, 30.0, 30.0, 16.0, 12.0, np.eye(4))


def masked(folder: Path, shown: np.ndarray, lens: Lens | None = None) -> Capture:
    save_image(folder / "mask.png", shown)
    camera = CAMERA if lens is None else lens.straight(np.eye(4))
    return Capture("a.jpg", folder / "a.jpg", camera, lens, mask_path=folder / "mask.png")


def test_masks_are_found_beside_their_photographs(tmp_path):
    images, masks = tmp_path / "images", tmp_path / "masks"
    (masks / "left").mkdir(parents=True)
    for name in ("a.png", "left/b.jpg.png"):
        (masks / name).touch()
    paths = [images / "a.jpg", images / "left" / "b.jpg", images / "c.jpg", tmp_path / "a.jpg"]
    captures = [Capture(path.name, path, CAMERA) for path in paths]
    found = [masks / "a.png", masks / "left" / "b.jpg.png", None]
    for folder in (tmp_path, images):
        assert [capture.mask_path for capture in with_masks_beside(captures, folder)][:3] == found
    assert with_masks_beside(captures, tmp_path)[3].mask_path == masks / "a.png"
    named = Capture("a.jpg", paths[0], CAMERA, mask_path=tmp_path / "mine.png")
    assert with_masks_beside([named], tmp_path) == (named,)


def test_a_pixel_counts_where_nothing_of_it_is_black(tmp_path):
    shown = np.ones((48, 64), np.uint8)  # 1 is as good as 255
    shown[11, 20:30] = 0
    counted = counted_pixels(masked(tmp_path, shown))
    assert counted.shape == CAMERA.shape and counted.dtype == np.float32
    assert np.argwhere(counted == 0.0).tolist() == [[5, column] for column in range(10, 15)]


def test_a_mask_is_freed_of_the_lens_as_its_photograph_is(tmp_path):
    lens = Lens(320, 240, 200.0, 200.0, 160.0, 120.0, (-0.25, 0.05, 0.0, 0.0))
    photograph = np.ones((240, 320, 3), np.float32)
    photograph[30:60, 40:90] = 0.0
    shown = photograph[::2, ::2, 0]  # of half its size
    capture = masked(tmp_path, shown, lens)
    seen = capture.seen(photograph)[..., 0]
    assert (np.abs(counted_pixels(capture) - seen) < 0.5).mean() > 0.995
    assert (seen < 0.5).mean() > 0.01


def test_a_mask_of_another_shape_is_named(tmp_path):
    capture = masked(tmp_path, np.ones((64, 48), np.uint8))
    with refused(CaptureError, "mask.png", "48x64, its photograph a.jpg"):
        counted_pixels(capture)
