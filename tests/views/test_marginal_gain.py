"""Targets that are chosen together: each by what no one before it shows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from wall_views import WALL_M, camera, wall

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.robot.rollouts.candidates import Candidates
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.views.allocation import allocate_views
from r2sego_blender.views.marginal_gain import MissingSurface, by_marginal_gain
from tools.benchmarks.workloads import made_up_path, made_up_proxy, made_up_room


class Numbered:
    """A surface of numbered points: what each candidate misses and what it shows are sets."""

    def __init__(self, missing: list[set[int]]) -> None:
        self._missing = missing

    def missing(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        points = np.array(sorted(self._missing[index]), float).reshape(-1, 1) * np.ones(3)
        return points, np.ones(len(points))

    def shown(self, index: int, points: np.ndarray, depths: np.ndarray) -> np.ndarray:
        assert points.shape == (len(depths), 3)
        return np.array([int(point[0]) in self._missing[index] for point in points], bool)


@given(st.lists(st.tuples(st.sets(st.integers(0, 12)), st.integers(1, 9)), min_size=1, max_size=8), st.integers(0, 9))
def test_each_is_the_best_of_those_left_by_what_no_one_before_it_shows(candidates, count):
    missing, score = [one for one, _ in candidates], np.array([number / 10.0 for _, number in candidates])
    order = np.argsort(-score, kind="stable")
    found, share = by_marginal_gain(order, score, Numbered(missing), count)
    assert sorted(found.tolist()) == list(range(len(candidates))) and len(share) == min(count, len(candidates))
    shown: set[int] = set()
    left = order.tolist()
    for index in found[:count].tolist():
        gains = [score[one] * (len(missing[one] - shown) / len(missing[one]) if missing[one] else 1.0) for one in left]
        assert index == left[int(np.argmax(gains))]
        assert score[index] * share[index] == pytest.approx(max(gains))
        shown |= missing[index]
        left.remove(index)
    assert found[count:].tolist() == left  # the others stay as they were
    if count:
        assert found[0] == order[0]  # that of Eq. 2


def moved(one: Camera, *by: float) -> Camera:
    pose = one.world_from_camera.copy()
    pose[:3, 3] += by
    return one.at(pose)


def test_a_view_shows_what_lies_in_it_and_is_not_hidden_or_much_farther():
    first = camera(0.0)
    cameras = [first, camera(0.5), camera(3.0), moved(first, 0.0, -1.0, 0.0), moved(first, 0.0, -2.2, 0.0)]
    hidden = len(cameras)
    cameras.append(camera(0.0))  # of which something stands before the wall

    def depth_of(one: Camera) -> np.ndarray:
        if (one.world_from_camera == cameras[hidden].world_from_camera).all() and calls.pop("hide", False):
            return np.full(one.shape, 0.5, np.float32)
        return wall(one) - np.float32(one.centre[1])

    calls: dict[str, bool] = {}
    surface = MissingSurface(cameras, SplatAsset.empty(), depth_of, SelectionSettings())
    points, depths = surface.missing(0)
    np.testing.assert_allclose(points[:, 1], WALL_M, atol=1e-6)
    small = first.fitted(80)
    assert len(points) == small.width * small.height and surface.shown(0, points, depths).all()
    assert surface.shown(1, points, depths).mean() == pytest.approx(0.75, abs=0.02)  # half a metre of two is beyond
    assert not surface.shown(2, points, depths).any()
    assert surface.shown(3, points, depths).all()  # 3 m off in place of 2
    assert not surface.shown(4, points, depths).any()  # 4.2 m: more than twice as far
    calls["hide"] = True
    assert not surface.shown(hidden, points, depths).any()


def test_what_the_asset_shows_is_not_missing():
    lens = made_up_room(4000, (96, 72)).views[0].camera
    whole = made_up_room(4000, (96, 72)).asset
    assert not len(
        MissingSurface(
            [lens], whole, lambda one: np.ones(one.shape, np.float32), SelectionSettings(alpha_threshold=0.0)
        ).missing(0)[0]
    )
    kept = whole.subset(whole.means[:, 0] < 0.5)
    some = MissingSurface([lens], kept, lambda one: np.ones(one.shape, np.float32), SelectionSettings()).missing(0)[0]
    assert 0 < len(some) <= lens.fitted(80).width * lens.fitted(80).height


def test_targets_look_at_different_gaps_where_their_scores_alone_would_have_them_look_at_one():
    workload = made_up_room(4000, (96, 72))
    lens = workload.views[0].camera
    asset, proxy = workload.asset.subset(workload.asset.means[:, 0] < 0.5), made_up_proxy(3000)
    path = made_up_path(lens, 30)
    poses = np.stack([one.world_from_camera for one in path])
    twice = Candidates(
        np.concatenate([poses, poses]), np.repeat(np.int32([0, 1]), 30), np.tile(np.arange(30, dtype=np.int32), 2)
    )
    captures = [path[5], path[20]]

    def chosen(ranking: str):
        settings = SelectionSettings(target_views=3, nms_window=6, overlap_scale=0.5, ranking=ranking)
        return allocate_views(twice, lens, asset, proxy, captures, settings)

    alone, together = chosen("score"), chosen("marginal")
    assert len(set(alone.frame[alone.targets])) == 2  # of two equal rollouts both
    assert len(set(together.frame[together.targets])) == 3
    assert together.targets[0] == alone.targets[0]
    assert alone.ablations == ("selection.ranking = score",) and together.ablations == ()
    np.testing.assert_array_equal(together.score, alone.score)
    assert (alone.marginal == 1.0).all() and together.marginal[together.targets[0]] == 1.0
    gains = (together.score * together.marginal)[together.targets]
    assert (np.diff(gains) <= 0.0).all() and gains[-1] > 0.0  # what is left to gain only falls
    assert (together.reference[together.targets] >= 0).all()
