"""Pictures drawn side by side are those drawn one by one, to the bit and in their order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from splat_reference import random_asset, small_camera

from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.batch_rasterizer import BatchRasterizer
from r2sego_blender.splats.rendering.rasterizer import Rasterizer


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("count", [1, 2, 17])
def test_each_picture_is_that_of_the_rasterizer_to_the_bit(threads, count):
    asset = PackedGaussians.of(random_asset(np.random.default_rng(5), 300))
    camera = small_camera(64, 64)
    cameras = [replace(camera, cx=camera.cx + 0.7 * number) for number in range(count)]
    with BatchRasterizer(asset, threads) as batch:
        for _ in range(2):  # the threads keep their buffers
            drawn = batch.colours(cameras)
            assert drawn.shape == (count, 64, 64, 3)
            for picture, camera in zip(drawn, cameras, strict=True):
                rasterizer = Rasterizer()
                rasterizer.forward(asset, camera, with_depth=False)
                np.testing.assert_array_equal(picture, rasterizer.colour)
    assert len({picture.tobytes() for picture in drawn}) == count
