from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.kernels.tiles import TILE_PX
from r2sego_blender.splats.training.lattice import Lattice
from r2sego_blender.splats.training.observations import Observation, Target, Targets

CAMERA = Camera(50, 34, 40.0, 42.0, 24.0, 18.0, np.eye(4))
IMAGE_BYTES = 3 * 50 * 34


def picture(seed: int, camera: Camera = CAMERA) -> np.ndarray:
    return np.random.default_rng(seed).random((*camera.shape, 3)).astype(np.float32)


def full_observation(seed: int = 0) -> Observation:
    """One with everything that can be known of a view."""
    rng = np.random.default_rng(seed)
    plane = rng.random((6, *CAMERA.shape)).astype(np.float32)
    depth = np.where(plane[2] > 0.3, 1.0 + plane[3], 0.0).astype(np.float32)
    return Observation(
        CAMERA,
        picture(seed),
        confidence=plane[0],
        background=picture(seed + 1),
        opaque=plane[1],
        depth=depth,
        normals=picture(seed + 2),
        depth_confidence=plane[4],
    )


class Loads:
    """A source of an image that counts how often it is asked."""

    def __init__(self, seed: int) -> None:
        self.times, self._image = 0, picture(seed)

    def __call__(self) -> np.ndarray:
        self.times += 1
        return self._image


def arrays_of(target: Target) -> list[np.ndarray]:
    values = (getattr(target, field.name) for field in dataclasses.fields(target))
    return [value for value in values if isinstance(value, np.ndarray)]


def target_of(view: Observation, lattice: Lattice = Lattice()) -> Target:
    return Target.of(view, lattice, view.image, view.confidence)


def test_the_whole_target_has_the_observations_pixels() -> None:
    view = full_observation()
    target = target_of(view)
    height, width = CAMERA.shape
    assert target.camera is CAMERA
    assert target.image.shape == (3, 2 * TILE_PX, 2 * TILE_PX)
    assert target.weights.shape == (1, 2 * TILE_PX, 2 * TILE_PX)
    for name in ("image", "background"):
        planes, expected = getattr(target, name), np.moveaxis(getattr(view, name), 2, 0)
        np.testing.assert_array_equal(planes[:, :height, :width], expected)
    np.testing.assert_array_equal(target.weights[0, :height, :width], view.confidence)
    for plane in (*target.image, *target.background, *target.weights):
        assert not plane[height:].any() and not plane[:, width:].any()
    for name in ("opaque", "depth", "normals"):
        np.testing.assert_array_equal(getattr(target, name), getattr(view, name))
    np.testing.assert_array_equal(target.depth_weight, view.depth_confidence * (view.depth > 0))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.integers(1, 7), st.integers(0, 6), st.integers(0, 6))
def test_a_lattices_target_is_that_of_its_pixels_alone(stride: int, row: int, column: int) -> None:
    view, lattice = full_observation(), Lattice(stride, row % stride, column % stride)
    camera = lattice.camera(CAMERA)
    names = ("image", "confidence", "background", "opaque", "depth", "normals", "depth_confidence")
    alone = Observation(camera, **{name: lattice.pixels(getattr(view, name)) for name in names})
    target, expected = target_of(view, lattice), target_of(alone)
    assert target.camera.shape == camera.shape
    for found, wanted in zip(arrays_of(target), arrays_of(expected), strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_what_is_not_known_is_none() -> None:
    target = target_of(Observation(CAMERA, picture(0)), Lattice(2))
    for name in ("weights", "background", "opaque", "depth", "normals", "depth_weight"):
        assert getattr(target, name) is None
    depth = np.where(picture(1)[..., 0] > 0.5, 2.0, 0.0).astype(np.float32)
    target = target_of(Observation(CAMERA, picture(0), depth=depth))
    np.testing.assert_array_equal(target.depth_weight, depth > 0.0)
    assert target.normals is None


def test_an_image_is_loaded_when_it_is_needed_and_again_after_it_made_room() -> None:
    sources = [Loads(k) for k in range(3)]
    targets = Targets([Observation(CAMERA, source) for source in sources], 2 * IMAGE_BYTES)
    assert [source.times for source in sources] == [0, 0, 0]
    first = targets.get(0, Lattice())
    for lattice in (Lattice(), Lattice(3, 1, 2), Lattice(2)):
        targets.get(0, lattice)
    targets.get(1, Lattice())
    assert [source.times for source in sources] == [1, 1, 0]
    targets.get(0, Lattice())  # now 1 is the one used longest ago
    targets.get(2, Lattice())
    np.testing.assert_array_equal(targets.get(0, Lattice()).image, first.image)
    assert [source.times for source in sources] == [1, 1, 1]
    targets.get(1, Lattice())
    assert [source.times for source in sources] == [1, 2, 1]


def test_what_is_loaded_is_kept_in_8_bits_and_what_is_there_as_it_is() -> None:
    in_8_bits = np.random.default_rng(0).integers(0, 256, (*CAMERA.shape, 3), np.uint8)
    photograph = in_8_bits.astype(np.float32) / 255.0
    mask = (picture(1)[..., 0] > 0.5).astype(np.float32)
    resized = picture(2)
    views = [
        Observation(CAMERA, photograph, confidence=mask),
        Observation(CAMERA, lambda: photograph, confidence=lambda: mask),
        Observation(CAMERA, lambda: resized),
    ]
    targets = Targets(views, 1 << 20)
    for lattice in (Lattice(), Lattice(3, 2, 1)):
        there, loaded, rounded = (targets.get(index, lattice) for index in range(3))
        np.testing.assert_array_equal(loaded.image, there.image)
        np.testing.assert_array_equal(loaded.weights, there.weights)
        assert rounded.image.dtype == np.float32
        expected = target_of(Observation(CAMERA, resized), lattice).image
        np.testing.assert_allclose(rounded.image, expected, atol=0.5001 / 255.0)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.lists(st.integers(0, 4), max_size=25), st.integers(1, 6))
def test_what_is_kept_stays_within_the_budget(requests: list[int], images: int) -> None:
    views = [dataclasses.replace(full_observation(k), image=Loads(k)) for k in range(5)]
    targets = Targets(views, images * IMAGE_BYTES)
    for index in requests:
        expected = np.rint(picture(index)[::2, 1::2] * 255.0) / np.float32(255.0)
        found = targets.get(index, Lattice(2, 0, 1)).image[:, :17, :25]
        np.testing.assert_array_equal(found, np.moveaxis(expected, 2, 0))
        assert targets._bytes == IMAGE_BYTES * len(targets._kept) <= images * IMAGE_BYTES


def test_an_image_larger_than_the_budget_is_kept_alone() -> None:
    sources = [Loads(k) for k in range(2)]
    targets = Targets([Observation(CAMERA, source) for source in sources], 1)
    for index in (0, 0, 1, 1, 0):
        targets.get(index, Lattice())
    assert [source.times for source in sources] == [2, 1]


@pytest.mark.parametrize("name", ["confidence", "opaque", "depth", "depth_confidence"])
def test_maps_of_another_size_are_refused(name: str) -> None:
    with pytest.raises(AssetError, match=rf"observation's {name} has the shape \(3, 3\)"):
        Observation(CAMERA, picture(0), **{name: np.zeros((3, 3), np.float32)})


@pytest.mark.parametrize("name", ["background", "normals"])
def test_images_of_another_size_are_refused(name: str) -> None:
    with pytest.raises(AssetError, match=rf"observation's {name} has the shape"):
        Observation(CAMERA, picture(0), **{name: np.zeros(CAMERA.shape, np.float32)})


def test_a_loaded_image_of_another_size_is_refused_when_it_is_loaded() -> None:
    view = Observation(CAMERA, lambda: np.zeros((3, 3, 3), np.float32))
    for use in (view.loaded, lambda: Targets([view], 1 << 20).get(0, Lattice())):
        with pytest.raises(AssetError, match=r"observation's image has the shape \(3, 3, 3\)"):
            use()
    with pytest.raises(AssetError, match="Scale the image or the camera"):
        Observation(CAMERA, picture(0)[:-1])


def test_normals_need_the_depth_of_their_surface() -> None:
    camera = Camera(8, 6, 8.0, 8.0, 4.0, 3.0, np.eye(4))
    with pytest.raises(AssetError, match="has normals but no depth"):
        Observation(camera, np.zeros((6, 8, 3), np.float32), normals=np.zeros((6, 8, 3), np.float32))
