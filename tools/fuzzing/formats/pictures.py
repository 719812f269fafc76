"""Photographs, masks and depth maps of a sensor."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.images import load_image, load_image_uint8, save_image

from ..harness import Harness
from ..seeds import SIZE, camera, of_tests, photographs, pixels, save_picture

_OPTIONS: dict[str, dict[str, Any]] = {".tif": {"compression": "tiff_lzw"}, ".webp": {"lossless": True}}


def _picture(suffix: str) -> Callable[[Path], None]:
    return lambda folder: save_picture(folder / f"a{suffix}", **_OPTIONS.get(suffix, {}))


def _load(suffix: str) -> Callable[[Path], Any]:
    def load(folder: Path) -> Any:
        from r2sego_blender.captures.poses.photographs import upright_size

        image = load_image(folder / f"a{suffix}")
        return image, upright_size(folder / f"a{suffix}")

    return load


def _capture(folder: Path) -> Capture:
    return Capture("a.png", folder / "a.png", camera())


def _mask(folder: Path) -> None:
    photographs(folder)
    save_image(folder / "mask.png", pixels() // 128 * 255)


def _read_mask(folder: Path) -> Any:
    from r2sego_blender.captures.masks import counted_pixels

    capture = Capture("a.png", folder / "a.png", camera(), mask_path=folder / "mask.png")
    return counted_pixels(capture)


def _video(folder: Path) -> None:
    videos = of_tests("phone_videos")
    videos.state_colours(videos.write_video(folder / "a.mp4", [pixels(i) for i in range(3)], turns=0), 9, 18, 9)


def _video_colours(folder: Path) -> Any:
    from r2sego_blender.captures.keyframes.video_colours import colours_of

    return colours_of(folder / "a.mp4").to_srgb(pixels())


def _depth_map() -> np.ndarray:
    width, height = SIZE
    return np.linspace(1.0, 4.0, width * height).reshape(height, width).astype(np.float32)


def _depth(suffix: str, compressed: bool = False) -> Callable[[Path], None]:
    def build(folder: Path) -> None:
        photographs(folder)
        (folder / "depth").mkdir()
        file, depth = folder / "depth" / f"a{suffix}", _depth_map()
        if suffix == ".npz":
            (np.savez_compressed if compressed else np.savez)(file, depth=depth)
        elif suffix == ".npy":
            np.save(file, depth)
        elif suffix == ".exr":
            import OpenEXR

            header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
            with OpenEXR.File(header, {"Z": depth}) as image:
                image.write(str(file))
        else:
            import cv2

            file.write_bytes(cv2.imencode(suffix, (depth * 1000).astype(np.uint16))[1].tobytes())

    return build


def _read_depth(folder: Path) -> Any:
    from r2sego_blender.captures.sensors.sensor_depth import SensorDepth

    depth = SensorDepth.beside(folder / "depth").of(_capture(folder), "a")
    assert depth is not None
    if (depth < 0).any():
        return float("nan")
    return depth


def _read_recorded(folder: Path) -> Any:
    from r2sego_blender.captures.sparse_points import SparsePoints
    from r2sego_blender.geometry.estimators.backends import depth_estimator

    nothing = SparsePoints(*(np.zeros((0, *rest)) for rest in ((3,), (3,), (1,), (), (1, 2))))
    found = depth_estimator("recorded", folder=folder / "depth", inverse=True).estimate([_capture(folder)], nothing)
    return found["a.png"].depth, found["a.png"].sigma


def _confidence(folder: Path) -> None:
    _depth(".npy")(folder)
    (folder / "confidence").mkdir()
    save_image(folder / "confidence/a.png", pixels()[..., 0] % 3)


def _thumbnail(folder: Path) -> Any:
    return load_image_uint8(folder / "a.png")


def _numbered(folder: Path) -> None:
    photographs(folder)
    (folder / "masks").mkdir()
    save_image(folder / "masks/a.png", pixels()[..., 0] // 100)
    (folder / "masks/names.json").write_text(json.dumps({"1": "chair", "2": "table"}))


def _read_numbered(folder: Path) -> Any:
    from r2sego_blender.geometry.objects.objects import read_masks

    return read_masks(folder / "masks", [_capture(folder)])


HARNESSES = (
    Harness("pictures/names.json", _numbered, "masks/names.json", "json", _read_numbered),
    Harness("pictures/numbered.png", _numbered, "masks/a.png", "png", _read_numbered),
    Harness("pictures/png", _picture(".png"), "a.png", "png", _load(".png")),
    *(
        Harness(f"pictures/{suffix[1:]}", _picture(suffix), f"a{suffix}", "bytes", _load(suffix))
        for suffix in (".jpg", ".tif", ".webp", ".bmp", ".avif", ".heic")
    ),
    Harness("pictures/colours.mp4", _video, "a.mp4", "bytes", _video_colours),
    Harness("pictures/mask.png", _mask, "mask.png", "png", _read_mask),
    Harness("depth/png", _depth(".png"), "depth/a.png", "png", _read_depth),
    Harness("depth/tif", _depth(".tif"), "depth/a.tif", "bytes", _read_depth),
    Harness("depth/npy", _depth(".npy"), "depth/a.npy", "npy", _read_depth),
    Harness("depth/npz", _depth(".npz"), "depth/a.npz", "npz", _read_depth),
    Harness("depth/packed.npz", _depth(".npz", compressed=True), "depth/a.npz", "npz", _read_depth),
    Harness("depth/exr", _depth(".exr"), "depth/a.exr", "bytes", _read_depth, share=0.04),
    Harness("estimates/recorded.npy", _depth(".npy"), "depth/a.npy", "npy", _read_recorded),
    Harness("depth/confidence.png", _confidence, "confidence/a.png", "png", _read_depth),
)
