"""Depth maps that say more than they hold, or what is no depth."""

from __future__ import annotations

import unicodedata
import zipfile

import cv2
import numpy as np
import OpenEXR
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sensors.sensor_depth import SensorDepth, map_in_own_unit
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb

CAMERA = Camera(32, 24, 20.0, 20.0, 16.0, 12.0, np.eye(4))


@pytest.fixture
def capture(tmp_path):
    return Capture("c.png", tmp_path / "c.png", CAMERA)


def _write(path, values):
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".npz":
        np.savez_compressed(path, depth=values)
    else:
        with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"Z": values.astype(np.float32)}) as image:
            image.write(str(path))


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".exr"])
def test_what_is_no_depth_is_unknown(tmp_path, capture, suffix):
    values = np.full((24, 32), 2.0)
    values[0, :5] = [np.nan, np.inf, -np.inf, -1.0, 1e300 if suffix != ".exr" else 1e30]
    _write(tmp_path / f"c{suffix}", values)
    depth = SensorDepth(tmp_path).of(capture, "c")
    assert depth.dtype == np.float32
    assert (depth[0, :5] == 0.0).all() and (depth[1:] == 2.0).all()


@pytest.mark.parametrize("shape", [(24, 32, 0), (0, 32), (24,), (1, 24, 32, 1)])
def test_an_array_of_no_map_is_refused(tmp_path, capture, shape):
    np.save(tmp_path / "c.npy", np.zeros(shape, np.float32))
    with pytest.raises(CaptureError, match=r"c\.npy: .*no depth map"):
        SensorDepth(tmp_path).of(capture, "c")


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
def test_a_small_file_of_a_vast_map_takes_no_memory(tmp_path, capture, suffix):
    """3 MB of NPZ, 1.2 MB of EXR."""
    _write(tmp_path / f"c{suffix}", np.zeros((9000, 9000), np.float32))
    forget_peak_memory()
    before_mb = peak_memory_mb()
    with pytest.raises(CaptureError, match=rf"c\{suffix}"):
        SensorDepth(tmp_path).of(capture, "c")
    assert before_mb is None or peak_memory_mb() - before_mb < 200.0


def test_an_array_that_says_more_than_it_holds_is_refused(tmp_path, capture):
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive, archive.open("depth.npy", "w") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)})
    with pytest.raises(CaptureError, match=r"c\.npz: .*no depth map"):
        SensorDepth(tmp_path).of(capture, "c")


def test_an_exr_without_channels_is_refused(tmp_path, capture):
    (tmp_path / "c.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(40))
    with pytest.raises(CaptureError, match=r"c\.exr"):
        SensorDepth(tmp_path).of(capture, "c")


@pytest.mark.parametrize("worst", [1e6, np.nan])
def test_a_confidence_that_is_none_is_refused(tmp_path, capture, worst):
    for name in ("depth", "confidence"):
        (tmp_path / name).mkdir()
    np.save(tmp_path / "depth/c.npy", np.ones((24, 32), np.float32))
    believed = np.full((24, 32), 2.0, np.float32)
    believed[3, 4] = worst
    assert cv2.imwrite(str(tmp_path / "confidence/c.tiff"), believed)
    with pytest.raises(CaptureError, match=r"c\.tiff: .*no confidence"):
        SensorDepth.beside(tmp_path / "depth").of(capture, "c")


@pytest.mark.parametrize("suffix", [".NPY", ".NPZ", ".EXR"])
def test_a_suffix_may_be_in_capitals(tmp_path, capture, suffix):
    values = np.linspace(1.0, 2.0, 24 * 32, dtype=np.float32).reshape(24, 32)
    _write(tmp_path / f"c{suffix.lower()}", values)
    (tmp_path / f"c{suffix.lower()}").rename(tmp_path / f"c{suffix}")
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "c"), values)


def _slope():
    return np.linspace(1.0, 2.0, 24 * 32, dtype=np.float32).reshape(24, 32)


@pytest.mark.parametrize("values", [_slope()[None], _slope()[..., None], np.stack([_slope()] * 3, axis=-1)])
def test_a_map_may_have_an_axis_more(tmp_path, capture, values):
    np.save(tmp_path / "c.npy", values)
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "c"), _slope())


def test_a_coloured_picture_of_depth_is_refused(tmp_path, capture):
    """What a model's demo shows: one of its channels alone would be taken for depth."""
    levels = np.linspace(0, 255, 24 * 32).astype(np.uint8).reshape(24, 32)
    cv2.imwrite(str(tmp_path / "c.png"), cv2.applyColorMap(levels, cv2.COLORMAP_JET))
    with pytest.raises(CaptureError, match=r"c\.png: .*no depth map"):
        map_in_own_unit(tmp_path, "c", capture)
    cv2.imwrite(str(tmp_path / "c.png"), cv2.merge([levels] * 3 + [np.full_like(levels, 255)]))
    np.testing.assert_array_equal(map_in_own_unit(tmp_path, "c", capture), levels)


def test_points_are_no_depth(tmp_path, capture):
    """(H, W, 3) of a model of points: its first numbers are x."""
    np.save(tmp_path / "c.npy", np.stack([_slope(), -_slope(), 2.0 * _slope()], axis=-1))
    with pytest.raises(CaptureError, match=r"c\.npy: .*no depth map"):
        SensorDepth(tmp_path).of(capture, "c")


def _write_exr(path, *parts):
    """An EXR of one or more parts, each a name and its channels."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File([OpenEXR.Part(dict(header), channels, name) for name, channels in parts]) as image:
        image.write(str(path))


def _colours(layer=""):
    grey = np.full((24, 32), 0.5, np.float32)
    return {f"{layer}R": grey, f"{layer}G": 0.5 * grey, f"{layer}B": 0.2 * grey, f"{layer}A": np.ones_like(grey)}


@pytest.mark.parametrize(
    "parts",
    [
        [("", {**_colours(), "Z": _slope()})],
        [
            (
                "",
                {
                    **_colours("ViewLayer.Combined."),
                    "ViewLayer.Depth.Z": _slope(),
                    "ViewLayer.Normal.Z": _slope()[::-1],
                },
            )
        ],
        [("ViewLayer.Combined", _colours()), ("ViewLayer.Depth", {"Z": _slope()})],
        [("", {"R": _slope(), "G": _slope(), "B": _slope(), "A": np.ones((24, 32), np.float32)})],
        [("", {"V": _slope()})],
    ],
    ids=["beside colours", "of layers", "of parts", "as colours", "alone"],
)
def test_of_an_exr_with_colours_its_depth_is_taken(tmp_path, capture, parts):
    """Blender's multilayer files among them, whose first channel is the transparency of the picture."""
    _write_exr(tmp_path / "c.exr", *parts)
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "c"), _slope())


def test_an_exr_of_colours_is_no_depth(tmp_path, capture):
    _write_exr(tmp_path / "c.exr", ("", _colours()))
    with pytest.raises(CaptureError, match=r"c\.exr: .*no depth map"):
        SensorDepth(tmp_path).of(capture, "c")


def test_of_several_arrays_that_of_depth_is_taken(tmp_path, capture):
    np.savez(tmp_path / "c.npz", conf=np.ones((24, 32), np.float32), depth=_slope())
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "c"), _slope())
    np.savez(tmp_path / "c.npz", conf=np.ones((24, 32), np.float32), far=_slope())
    with pytest.raises(CaptureError, match=r"c\.npz: .*conf, far"):
        SensorDepth(tmp_path).of(capture, "c")


def test_two_maps_of_one_photograph_are_refused(tmp_path, capture):
    """A model's program writes a picture to look at beside each array."""
    np.save(tmp_path / "c.npy", _slope())
    cv2.imwrite(str(tmp_path / "c.png"), np.full((24, 32), 128, np.uint8))
    for read in (lambda: map_in_own_unit(tmp_path, "c", capture), lambda: SensorDepth(tmp_path).of(capture, "c")):
        with pytest.raises(CaptureError, match=r"c\.npy and c\.png"):
            read()


@pytest.mark.parametrize("name", ["KÜCHE.npy", unicodedata.normalize("NFD", "Küche.npy")])
def test_a_map_may_be_called_in_another_case_or_composition(tmp_path, capture, name):
    """As a Mac or a copy by Windows leaves it; one that is called exactly so goes before it."""
    np.save(tmp_path / name, _slope())
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "Küche"), _slope())
    np.save(tmp_path / "Küche.npy", 2.0 * _slope())
    np.testing.assert_array_equal(SensorDepth(tmp_path).of(capture, "Küche"), 2.0 * _slope())
