"""Learned estimators by known answers: a plane of known place, as each model tells it in its own conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.core.images import save_image
from r2sego_blender.core.progress import Progress
from r2sego_blender.geometry.estimators import depth_anything_3, dust3r, mapanything, moge, vggt
from r2sego_blender.geometry.estimators.learned import LearnedEstimator
from r2sego_blender.workers.learned_backends import LEARNED_BACKENDS
from r2sego_blender.workers.protocol.asking import Tell
from r2sego_blender.workers.protocol.response import Limits
from r2sego_blender.workers.protocol.serving import RANDOM, Answer, answer

NORMAL, OFFSET = np.array([0.4, 1.0, 0.3]), 4.0
"""A wall: world points X with NORMAL @ X = OFFSET."""

NO_POINTS = SparsePoints.none(4)
PLACES = [((-0.8, 0.0, 1.4), (0.1, 3, 1)), ((0.0, 0.2, 1.5), (0, 3, 1.2)), ((0.7, -0.1, 1.3), (0.4, 3, 1.5))]


class Model:
    """A worker that answers by a function, in this process, through the protocol's folders."""

    name, cure = "a model", "none"

    def __init__(self, said, weights: str = "0" * 64) -> None:
        self.said, self.weights, self.requests = said, weights, []

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        def depth(asked, progress) -> Answer:
            inputs = {name: asked.array(name) for name in asked.files}
            self.requests.append(inputs)
            return Answer("A model 1.0", self.weights, self.said(**inputs))

        answer(request, response, {"depth": depth}, lambda *line: None)

    def close(self) -> None:
        """Nothing runs."""


class Told(Progress):
    def __init__(self) -> None:
        self.warnings: list[str] = []

    def message(self, text: str, level: str = "info") -> None:
        if level == "warning":
            self.warnings.append(text)


def capture(folder: Path, index: int, size: tuple[int, int] = (200, 150)) -> Capture:
    path = folder / f"{index}.png"
    rng = np.random.default_rng(index)
    save_image(path, np.kron(rng.random((5, 5, 3)), np.ones((size[1] // 5, size[0] // 5, 1))).astype(np.float32))
    centre, target = PLACES[index % len(PLACES)]
    lens = (0.8 * size[0], 0.82 * size[0], 0.5 * size[0] + 3.0, 0.5 * size[1] - 2.0)
    return Capture(path.name, path, Camera(*size, *lens, look_at(np.array(centre), np.array(target))))


@pytest.fixture
def captures(tmp_path: Path) -> list[Capture]:
    return [capture(tmp_path, index) for index in range(3)]


def wall(matrix, camera_from_world, shape, centre: float) -> np.ndarray:
    """Planar depth of the wall; pixel (0, 0) has its centre at ``centre``, ``centre``."""
    world_from_camera = np.linalg.inv(camera_from_world)
    v, u = np.mgrid[: shape[0], : shape[1]] + centre
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1], np.ones_like(u)], -1)
    depth = (OFFSET - NORMAL @ world_from_camera[:3, 3]) / (rays @ world_from_camera[:3, :3].T @ NORMAL)
    assert (depth > 0).all()
    return depth.astype(np.float32)


def truth(one: Capture, shape) -> np.ndarray:
    camera = one.camera.fitted(max(shape))
    assert camera.shape == shape
    return wall(camera.matrix, camera.camera_from_world, shape, 0.5)


def assert_the_wall(estimator: LearnedEstimator, captures, unit: float = 1.0, seen: float = 1.0) -> dict:
    found = estimator.estimate(captures, NO_POINTS)
    assert set(found) == {one.name for one in captures}
    for one in captures:
        estimate = found[one.name]
        known = estimate.valid
        assert known.mean() > seen - 1e-9
        np.testing.assert_allclose(estimate.depth[known], unit * truth(one, known.shape)[known], rtol=5e-5)
        assert (estimate.sigma[known] > 0).all()
    return found


def ramp(pictures) -> np.ndarray:
    """A confidence of at least 1 that differs from pixel to pixel."""
    return np.broadcast_to(1.0 + np.arange(pictures.shape[2], dtype=np.float32) / 8, pictures.shape[:3]).copy()


def test_depth_anything_3_is_told_poses_from_the_world_to_the_camera_and_pixel_centres_at_halves(captures):
    def said(pictures, intrinsics, camera_from_world):
        assert pictures.shape == (3, 378, 504, 3)
        depth = [wall(k, pose, pictures.shape[1:3], 0.5) for k, pose in zip(intrinsics, camera_from_world, strict=True)]
        return {
            "depth": np.stack(depth),
            "confidence": ramp(pictures),
            "intrinsics": intrinsics,
            "camera_from_world": camera_from_world[:, :3],
        }

    found = assert_the_wall(depth_anything_3.Estimator("depth-anything-3-base", worker=Model(said)), captures)
    sigma = found["0.png"].sigma
    # Column c of 200 lies at 504 (c + 0.5) / 200 of the picture; sigma falls as the confidence there grows.
    columns = np.floor(504 * (np.arange(200) + 0.5) / 200)
    np.testing.assert_allclose(sigma[0], 1 / (1 + columns / 8), rtol=1e-6)


def test_depth_anything_3_is_told_no_poses_that_a_similarity_cannot_be_found_by(captures):
    def said(pictures, **told):
        assert not told
        count = len(pictures)
        return {
            "depth": np.ones(pictures.shape[:3], np.float32),
            "confidence": ramp(pictures),
            "intrinsics": np.tile(np.eye(3), (count, 1, 1)),
            "camera_from_world": np.tile(np.eye(4)[:3], (count, 1, 1)),
        }

    estimator = depth_anything_3.Estimator("depth-anything-3-base", worker=Model(said))
    assert len(estimator.estimate(captures[:2], NO_POINTS)) == 2
    line = [np.array([x, 0.0, 1.4]) for x in (0.0, 0.5, 1.0)]
    assert not depth_anything_3.span_a_plane(np.array(line))
    assert not depth_anything_3.span_a_plane(np.zeros((4, 3)))
    assert depth_anything_3.span_a_plane(np.array([*line, [0.5, 0.4, 1.4]]))


def test_mapanything_is_told_poses_from_the_camera_to_the_world_and_pixel_centres_at_integers(captures):
    def said(pictures, intrinsics, camera_poses):
        assert pictures.shape == (3, 392, 518, 3)
        shape = pictures.shape[1:3]
        depth = [wall(k, np.linalg.inv(p), shape, 0.0) for k, p in zip(intrinsics, camera_poses, strict=True)]
        depth[1][:100] = 0.0  # masked
        first = np.linalg.inv(camera_poses[0])
        return {
            "depth_z": np.stack(depth),
            "confidence": ramp(pictures),
            "intrinsics": intrinsics,
            "camera_poses": first @ camera_poses,
        }

    model = Model(said)
    assert_the_wall(mapanything.Estimator("mapanything", worker=model), captures, seen=0.7)


def test_vggt_is_told_pictures_alone_and_its_unit_is_its_own(captures):
    unit = 0.37

    def said(pictures):
        assert pictures.shape == (3, 392, 518, 3)
        place = vggt.Estimator("vggt").placements([(200, 150)])[0]
        matrices = np.stack([place.matrix(one.camera) for one in captures])
        poses = np.stack([one.camera.camera_from_world for one in captures])
        depth = [unit * wall(k, pose, pictures.shape[1:3], 0.5) for k, pose in zip(matrices, poses, strict=True)]
        told = poses @ captures[0].camera.world_from_camera  # in the frame of the first
        told[:, :3, 3] *= unit
        return {
            "depth": np.stack(depth).astype(np.float32),
            "confidence": ramp(pictures),
            "intrinsics": matrices,
            "camera_from_world": told[:, :3],
        }

    assert_the_wall(vggt.Estimator("vggt", worker=Model(said)), captures, unit)


def test_the_cameras_that_vggt_and_mapanything_find_are_those_of_their_pictures(captures):
    estimator = vggt.Estimator("vggt")
    places = estimator.placements([(200, 150)] * 3)
    poses = np.stack([one.camera.camera_from_world for one in captures])
    shape = (3, places[0].height, places[0].width)
    said = {
        "depth": np.ones(shape, np.float32),
        "confidence": np.ones(shape, np.float32),
        "intrinsics": np.stack([places[0].matrix(one.camera) for one in captures]),
        "camera_from_world": poses[:, :3],
    }
    for seen, one in zip(estimator.seen(said, places), captures, strict=True):
        np.testing.assert_allclose(seen.camera.world_from_camera, one.camera.world_from_camera, atol=1e-12)
        np.testing.assert_allclose(seen.camera.matrix, places[0].matrix(one.camera))
        assert seen.camera.shape == shape[1:]
    metric = mapanything.Estimator("mapanything")
    told = metric.request(captures, places)
    of_mapanything = {"depth_z": said["depth"], "confidence": said["confidence"], **told}
    for seen, one in zip(metric.seen(of_mapanything, places), captures, strict=True):
        np.testing.assert_allclose(seen.camera.world_from_camera, one.camera.world_from_camera)
        np.testing.assert_allclose(seen.camera.matrix, places[0].matrix(one.camera))
    said["camera_from_world"] = 2.0 * said["camera_from_world"]
    assert [seen.camera for seen in estimator.seen(said, places)] == [None] * 3


def test_moge_is_told_the_field_of_view_and_knows_nothing_where_it_says_so(captures):
    place = moge.Estimator("moge-2").placements([(200, 150)])[0]
    lenses = iter(captures)

    def said(pictures, fov_x):
        # fx is 0.8 of the width: 2 atan(0.5 / 0.8)
        np.testing.assert_allclose(fov_x, 64.010766, rtol=1e-6)
        depth = []
        for _ in pictures:
            one = next(lenses)
            depth.append(wall(place.matrix(one.camera), one.camera.camera_from_world, (720, 960), 0.5))
        depth[0][:, :96] = 0.0  # as its worker leaves what is infinite
        return {"depth": np.stack(depth)}

    found = assert_the_wall(moge.Estimator("moge-2", worker=Model(said)), captures, seen=0.9)
    np.testing.assert_array_equal(found["0.png"].depth[:, :20], 0.0)
    assert (found["1.png"].sigma == 1.0).all()


def test_a_pointmaps_depth_is_its_z_in_its_own_camera_and_not_its_distance(captures):
    place = dust3r.Estimator("mast3r").placements([(200, 150)])[0]

    def said(pictures, pairs):
        assert pairs.tolist() == [[0, 1], [0, 2], [1, 2], [1, 0], [2, 1], [2, 0]]
        points = []
        for one in captures:
            matrix = place.matrix(one.camera)
            depth = wall(matrix, one.camera.camera_from_world, pictures.shape[1:3], 0.5)
            v, u = np.mgrid[: place.height, : place.width] + 0.5
            x, y = (u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1]
            points.append(np.stack([x * depth, y * depth, depth], axis=-1))
        return {"pts3d": np.stack(points).astype(np.float32), "confidence": ramp(pictures)}

    assert_the_wall(dust3r.Estimator("mast3r", worker=Model(said)), captures)


def test_pairs_put_each_view_first_with_those_that_look_where_it_does():
    angles = np.radians([0, 10, 90, 100, 180])
    forward = np.stack([np.cos(angles), np.sin(angles), np.zeros(5)], axis=1)
    pairs = dust3r.pairs_of(forward).tolist()
    assert [first for first, _ in pairs] == sorted(3 * list(range(5)))
    assert pairs[0] == [0, 1] and pairs[6] == [2, 3]
    assert all(first != second for first, second in pairs)
    assert dust3r.pairs_of(forward[:1]).tolist() == [[0, 0]]


def metric_one(pictures, fov_x):
    return {"depth": np.full(pictures.shape[:3], 2.0, np.float32)}


def test_photographs_of_another_shape_are_asked_for_apart_and_come_back_to_their_own(tmp_path):
    captures = [capture(tmp_path, 0), capture(tmp_path, 1, (150, 200)), capture(tmp_path, 2)]
    model = Model(metric_one)
    found = moge.Estimator("moge-2", worker=model).estimate(captures, NO_POINTS)
    assert [asked["pictures"].shape for asked in model.requests] == [(2, 720, 960, 3), (1, 960, 720, 3)]
    assert {name: one.depth.shape for name, one in found.items()} == {
        "0.png": (150, 200),
        "1.png": (200, 150),
        "2.png": (150, 200),
    }


def test_many_photographs_are_asked_for_in_several_requests_in_their_order(captures, monkeypatch):
    monkeypatch.setattr(moge.Estimator, "most_views", 2)
    model = Model(metric_one)
    assert len(moge.Estimator("moge-2", worker=model).estimate(captures, NO_POINTS)) == 3
    assert [len(asked["pictures"]) for asked in model.requests] == [2, 1]
    place = moge.Estimator("moge-2").placements([(200, 150)])[0]
    asked = np.concatenate([one["pictures"] for one in model.requests])
    np.testing.assert_array_equal(asked, [place.picture(one.image()) for one in captures])


def test_a_request_that_fails_costs_its_photographs_alone_and_they_are_named(tmp_path):
    captures = [capture(tmp_path, 0), capture(tmp_path, 1, (150, 200)), capture(tmp_path, 2)]

    def said(pictures, fov_x):
        told = metric_one(pictures, fov_x)
        if pictures.shape[1] > pictures.shape[2]:
            told["depth"][0, 0, 0] = np.nan
        return told

    told = Told()
    estimator = moge.Estimator("moge-2", told, Model(said))
    assert set(estimator.estimate(captures, NO_POINTS)) == {"0.png", "2.png"}
    assert estimator.label == "A model 1.0"
    assert len(told.warnings) == 1 and "1.png" in told.warnings[0]
    with pytest.raises(NativeError):
        estimator.estimate(captures[1:2], NO_POINTS)


@pytest.mark.parametrize(
    "depth",
    [np.ones((3, 100, 100), np.float32), np.ones((2, 720, 960), np.float32), np.ones((3, 720, 960), np.int32)],
    ids=["size", "count", "type"],
)
def test_an_answer_of_another_shape_is_refused(captures, depth):
    with pytest.raises(NativeError):
        moge.Estimator("moge-2", worker=Model(lambda **_: {"depth": depth})).estimate(captures, NO_POINTS)


def test_random_weights_are_never_taken_for_a_models(captures):
    with pytest.raises(NativeError):
        moge.Estimator("moge-2", worker=Model(metric_one, RANDOM)).estimate(captures, NO_POINTS)


def test_a_model_that_is_not_set_up_is_said_to_be_so(captures, monkeypatch, tmp_path):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "nothing"))
    monkeypatch.delenv(LEARNED_BACKENDS["vggt"].variable, raising=False)
    with pytest.raises(MachineError) as caught:
        vggt.Estimator("vggt").estimate(captures, NO_POINTS)
    assert LEARNED_BACKENDS["vggt"].variable in caught.value.cure
