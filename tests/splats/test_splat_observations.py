from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.cameras import Camera
from r2sego_blender.errors import AssetError
from r2sego_blender.splats.lattice import Lattice
from r2sego_blender.splats.observations import Observation, Target, TargetCache
from r2sego_blender.splats.tiles import TILE_PX

CAMERA = Camera(50, 34, 40.0, 42.0, 24.0, 18.0, np.eye(4))


def picture(seed: int, camera: Camera = CAMERA) -> np.ndarray:
    return np.random.default_rng(seed).random((*camera.shape, 3)).astype(np.float32)


def full_observation(seed: int = 0) -> Observation:
    """One with everything that can be known of a view."""
    rng = np.random.default_rng(seed)
    plane = rng.random((6, *CAMERA.shape)).astype(np.float32)
    depth = np.where(plane[2] > 0.3, 1.0 + plane[3], 0.0).astype(np.float32)
    return Observation(
        CAMERA, picture(seed), confidence=plane[0], background=picture(seed + 1), opaque=plane[1],
        depth=depth, normals=picture(seed + 2), depth_confidence=plane[4],
    )  # fmt: skip


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


def test_a_target_at_full_size_has_the_observations_pixels() -> None:
    view = full_observation()
    target = Target.of(view)
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
    target, expected = Target.of(view).at(lattice), Target.of(alone)
    assert target.camera.shape == camera.shape
    for found, wanted in zip(arrays_of(target), arrays_of(expected), strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_what_is_not_known_is_none() -> None:
    target = Target.of(Observation(CAMERA, picture(0))).at(Lattice(2))
    for name in ("weights", "background", "opaque", "depth", "normals", "depth_weight"):
        assert getattr(target, name) is None
    depth = np.where(picture(1)[..., 0] > 0.5, 2.0, 0.0).astype(np.float32)
    target = Target.of(Observation(CAMERA, picture(0), depth=depth))
    np.testing.assert_array_equal(target.depth_weight, depth > 0.0)
    assert target.normals is None


def test_an_image_is_loaded_when_it_is_needed_and_again_after_it_made_room() -> None:
    sources = [Loads(k) for k in range(3)]
    views = [Observation(CAMERA, source) for source in sources]
    size = Target.of(Observation(CAMERA, picture(0))).size_bytes
    cache = TargetCache(views, 2 * size)
    assert [source.times for source in sources] == [0, 0, 0]
    first = cache.get(0)
    assert cache.get(0) is first
    cache.get(1)
    assert [source.times for source in sources] == [1, 1, 0]
    cache.get(0)  # now 1 is the one used longest ago
    cache.get(2)
    assert cache.get(0) is first
    assert [source.times for source in sources] == [1, 1, 1]
    again = cache.get(1)
    assert [source.times for source in sources] == [1, 2, 1]
    np.testing.assert_array_equal(again.image, Target.of(views[1]).image)


def test_the_size_counts_every_array() -> None:
    target = Target.of(full_observation()).at(Lattice(3, 1, 2))
    assert target.size_bytes == sum(array.nbytes for array in arrays_of(target))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.lists(st.integers(0, 4), max_size=25), st.integers(1, 6))
def test_what_the_cache_holds_stays_within_its_budget(requests: list, images: int) -> None:
    views = [full_observation(k) for k in range(5)]
    budget = images * Target.of(views[0]).size_bytes
    cache = TargetCache(views, budget)
    for index in requests:
        assert cache.get(index).opaque is views[index].opaque
        held = sum(other.size_bytes for other in cache._targets.values())
        assert held == cache._bytes <= budget


def test_a_target_larger_than_the_budget_is_held_alone() -> None:
    sources = [Loads(k) for k in range(2)]
    cache = TargetCache([Observation(CAMERA, source) for source in sources], 1)
    for index in (0, 0, 1, 1, 0):
        cache.get(index)
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
    for use in (view.loaded, lambda: TargetCache([view], 1 << 20).get(0)):
        with pytest.raises(AssetError, match=r"observation's image has the shape \(3, 3, 3\)"):
            use()
    with pytest.raises(AssetError, match="Scale the image or the camera"):
        Observation(CAMERA, picture(0)[:-1])


def test_normals_need_the_depth_of_their_surface() -> None:
    camera = Camera(8, 6, 8.0, 8.0, 4.0, 3.0, np.eye(4))
    with pytest.raises(AssetError, match="has normals but no depth"):
        Observation(camera, np.zeros((6, 8, 3), np.float32), normals=np.zeros((6, 8, 3), np.float32))
