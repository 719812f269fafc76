"""RobotProxy as a pure function: of candidates, asset, proxy and settings, and of nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.robot.rollouts.candidates import Candidates
from r2sego_blender.views.allocation import allocate_views
from r2sego_blender.views.scoring.scores import support_scores
from r2sego_blender.views.selection import Selection
from tools.benchmarks.workloads import made_up_path, made_up_proxy, made_up_room

FRAMES, ROLLOUTS = 30, 3
SETTINGS = SelectionSettings(target_views=4, nms_window=6, overlap_scale=0.5)


@pytest.fixture(scope="module")
def room():
    """An asset with half of the room left out, its proxy, the candidates and two captures."""
    workload = made_up_room(4000, (96, 72))
    kept = workload.asset.means[:, 0] < 0.5
    lens = workload.views[0].camera
    path = made_up_path(lens, FRAMES * ROLLOUTS)
    number = np.arange(len(path))
    candidates = Candidates(
        poses=np.stack([camera.world_from_camera for camera in path]),
        rollout=(number // FRAMES).astype(np.int32),
        frame=(number % FRAMES).astype(np.int32),
    )
    return candidates, lens, workload.asset.subset(kept), made_up_proxy(3000), [path[5], path[70]]


def told(photographs):
    return [one.to_json() for one in photographs]


def same(a, b):
    return told(a.photographs) == told(b.photographs) and all(
        np.array_equal(value, getattr(b, name)) if isinstance(value, np.ndarray) else value == getattr(b, name)
        for name, value in vars(a).items()
        if name != "photographs"
    )


def test_targets_are_where_the_asset_lacks_and_the_proxy_has(room):
    candidates, lens, asset, proxy, captures = room
    selection = allocate_views(candidates, lens, asset, proxy, captures, SETTINGS, spares=2)
    cameras = [lens.at(pose) for pose in candidates.poses]
    deficit, availability = support_scores(cameras, asset, proxy, SETTINGS, captures=captures)
    np.testing.assert_array_equal(selection.deficit, deficit)
    np.testing.assert_array_equal(selection.availability, availability)
    # What looks into the half without splats misses more than what looks the other way.
    ahead = np.array([camera.forward[0] for camera in cameras])
    assert deficit[ahead > 0.6].mean() > deficit[ahead < -0.6].mean() + 0.2
    assert len(selection.targets) == 4
    assert selection.deficit[selection.targets].mean() > deficit.mean() + 0.1
    assert (selection.reference[selection.ranked[:6]] >= 0).all()
    assert (selection.reference >= 0).sum() == min(6, len(selection.ranked))
    assert selection.overlaps.shape == (len(cameras), 2)


def test_the_same_arguments_give_the_same_bits_on_one_thread(room, with_threads):
    first = allocate_views(*room, SETTINGS)
    second = with_threads(1, lambda: allocate_views(*room, SETTINGS))
    assert same(first, second)


def test_the_order_of_the_candidates_does_not_matter(room):
    candidates, *rest = room
    order = np.random.default_rng(0).permutation(len(candidates))
    shuffled = Candidates(candidates.poses[order], candidates.rollout[order], candidates.frame[order])
    first, second = allocate_views(candidates, *rest, SETTINGS), allocate_views(shuffled, *rest, SETTINGS)
    np.testing.assert_array_equal(order[second.targets], first.targets)
    np.testing.assert_array_equal(second.reference, first.reference[order])
    assert second.reason == tuple(first.reason[k] for k in order)
    assert told(second.photographs) == told(first.photographs) != []


def test_what_no_capture_saw_well_is_less_available(room):
    candidates, lens, asset, proxy, captures = room
    cameras = [lens.at(pose) for pose in candidates.poses]
    (_, seen), (_, supported) = (
        support_scores(cameras, asset, proxy, SETTINGS, captures=some) for some in (captures, [])
    )
    assert (seen <= supported).all()
    assert seen.mean() < supported.mean() - 0.05


@pytest.mark.parametrize("ranking", ["marginal", "score"])
def test_refused_candidates_give_way_to_the_next_best(room, ranking):
    candidates, _, _, _, captures = room
    settings = replace(SETTINGS, ranking=ranking)
    best = allocate_views(*room, settings)
    bad = {best.targets[0], best.targets[2]}
    asked = []

    def refusal(view, reference):
        index = int(np.flatnonzero((candidates.poses == view.world_from_camera).all(axis=(1, 2)))[0])
        assert any(reference is capture for capture in captures)
        asked.append(index)
        return "nothing is seen" if index in bad else ""

    selection = allocate_views(*room, settings, refusal=refusal)
    assert len(selection.targets) == len(best.targets) == SETTINGS.target_views
    assert not bad & set(selection.targets.tolist())
    if ranking == "score":  # else what the refused ones would have shown is left to others
        assert {best.targets[1], best.targets[3]} <= set(selection.targets.tolist())
    assert len(set(asked)) == len(asked) and set(selection.targets.tolist()) <= set(asked)
    for index in bad:
        assert selection.reason[index] == "refused: nothing is seen"
        assert not selection.survived[index] and selection.rank[index] == -1
    # Frames that a refused one suppressed may stand for it.
    assert (np.diff(np.sort(selection.frame[selection.targets][selection.rollout[selection.targets] == 0])) > 6).all()


def test_nothing_refused_changes_nothing(room):
    assert same(allocate_views(*room, SETTINGS), allocate_views(*room, SETTINGS, refusal=lambda view, reference: ""))


def test_when_all_fall_out_it_says_where_to_photograph(room, tmp_path):
    selection = allocate_views(*room, SETTINGS, spares=24, refusal=lambda view, reference: "nothing is seen")
    assert not len(selection.targets)
    assert selection.photographs and "x " in selection.note
    shares = [one.share for one in selection.photographs]
    assert shares == sorted(shares, reverse=True) and sum(shares) <= 1.0
    selection.save(tmp_path)
    loaded = Selection.load(tmp_path)
    assert loaded.note == selection.note
    for one, again in zip(selection.photographs, loaded.photographs, strict=True):
        assert again.share == one.share
        np.testing.assert_allclose(again.camera.world_from_camera, one.camera.world_from_camera)


def test_without_geometry_everything_is_available(room):
    settings = SelectionSettings(target_views=4, nms_window=6, geometry="ignored")
    selection = allocate_views(*room, settings)
    assert (selection.availability == 1.0).all()
    np.testing.assert_array_equal(selection.score, selection.deficit)
    assert selection.ablations == ("selection.geometry = ignored",)


def test_without_a_ranking_the_seed_draws_the_targets(room):
    settings = SelectionSettings(target_views=4, nms_window=6, ranking="random")
    first, again = (allocate_views(*room, settings, seed=[5, 1]) for _ in range(2))
    other = allocate_views(*room, settings, seed=[6, 1])
    assert same(first, again)
    assert first.targets.tolist() != other.targets.tolist()
    np.testing.assert_array_equal(first.score, other.score)  # what is measured stays
