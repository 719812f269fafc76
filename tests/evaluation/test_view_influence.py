"""The change of the frozen views' error, shared out to the generated views that see where it changed."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_bundle import FACES, HEIGHT, VERTICES, WIDTH, bundle, camera, photographs, splats

from r2sego_blender.captures.capture import DecodedCapture
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.arms import REFINED, WITHOUT_GENERATED
from r2sego_blender.evaluation.view_influence import attributed, told, view_influence
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import save_ply

LEFT, RIGHT = camera(-0.7), camera(0.7)


def true_depth(one):
    return MeshRasterizer(VERTICES, FACES).render(one).depth


def shown(*cameras):
    return [(one, true_depth(one)) for one in cameras]


@given(st.integers(0, 2**32 - 1), st.lists(st.floats(-2.0, 2.0), max_size=4))
@settings(max_examples=25, deadline=None)
def test_nothing_is_lost_and_nothing_counts_twice(seed, places):
    change = np.random.default_rng(seed).normal(size=(HEIGHT, WIDTH))
    shares, rest = attributed(camera(), true_depth(camera()), change, shown(*map(camera, places)))
    assert shares.sum() + rest == pytest.approx(change.sum(), abs=1e-6)
    assert len(shares) == len(places)


def test_a_change_belongs_to_the_views_that_see_it_in_equal_parts():
    change = np.zeros((HEIGHT, WIDTH))
    change[20:24, :6] = 1.0  # far left of the picture, which the camera to the right of it does not see
    shares, rest = attributed(camera(), true_depth(camera()), change, shown(LEFT, RIGHT))
    assert shares == pytest.approx([change.sum(), 0.0]) and rest == pytest.approx(0.0)
    shares, rest = attributed(camera(), true_depth(camera()), change, shown(LEFT, RIGHT, LEFT))
    assert shares == pytest.approx([change.sum() / 2, 0.0, change.sum() / 2]) and rest == pytest.approx(0.0)


def test_what_no_view_sees_is_elsewhere():
    """A wall before the one that is shown hides it; where nothing is shown, nobody sees anything."""
    change = np.ones((HEIGHT, WIDTH))
    hidden = [(LEFT, np.full(LEFT.shape, 0.5, np.float32))]
    assert attributed(camera(), true_depth(camera()), change, hidden) == (pytest.approx([0.0]), change.sum())
    nothing = np.zeros((HEIGHT, WIDTH), np.float32)
    assert attributed(camera(), nothing, change, shown(LEFT)) == (pytest.approx([0.0]), change.sum())


@pytest.fixture
def refined(tmp_path):
    """A bundle of one round with two generated views: one sees what is left of the middle, one the right."""
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    save_ply(scene.asset_file, splats(0.5, camera().scaled(1.0)))
    for rank, one in enumerate((camera(-2.0), camera(2.0))):
        folder = scene.round_folder(0) / f"views/{rank:03d}"
        folder.mkdir(parents=True)
        save_image(folder / "frame.png", np.full((*one.shape, 3), 0.5, np.float32))
        save_image(folder / "confidence.png", np.ones((*one.shape, 3), np.float32))
        record = {"accepted": True, "estimate": one.to_json(), "rank": rank, "reference": 0}
        (folder / "pose.json").write_text(json.dumps(record))
    return scene


def pictures(scene, folder, left, right):
    """Frozen views; pictures of the arm without generated views are off by so much on each side, refined ones right."""
    views = tuple(map(DecodedCapture.of, photographs(folder, (0.0,), "frozen")))
    truth = views[0].image()
    without = truth.copy()
    without[:, : WIDTH // 8] += left
    without[:, -WIDTH // 8 :] += right
    depths = [true_depth(view.camera) for view in views]
    return views, {WITHOUT_GENERATED: [without], REFINED: [truth]}, depths


def test_each_view_removes_the_error_where_it_looks(refined, tmp_path):
    entry = view_influence(refined, *pictures(refined, tmp_path, 0.2, 0.1))
    assert entry["removed"] == pytest.approx(1.0)
    left, right = entry["views"]
    assert (left["round"], left["rank"], right["rank"]) == (0, 0, 1)
    assert left["removed"] + right["removed"] + entry["elsewhere"] == pytest.approx(1.0, abs=2e-4)
    assert left["removed"] > 2.0 * right["removed"] > 0.0
    assert "100.0%" in told(entry)


def test_an_error_that_came_with_the_views_is_negative(refined, tmp_path):
    views, images, depths = pictures(refined, tmp_path, 0.1, 0.0)
    images[REFINED][0] = images[REFINED][0].copy()
    images[REFINED][0][:, -WIDTH // 8 :] += 0.3
    left, right = view_influence(refined, views, images, depths)["views"]
    assert left["removed"] > 0.0 > right["removed"]


def test_nothing_is_told_without_both_arms_or_without_views(refined, tmp_path):
    views, images, depths = pictures(refined, tmp_path, 0.1, 0.1)
    assert view_influence(refined, views, {REFINED: images[REFINED]}, depths) == {} and told({}) == ""
    shutil.rmtree(refined.round_folder(0) / "views")
    assert view_influence(refined, views, images, depths) == {}


def test_a_view_that_removed_nothing_removed_none_and_added_none():
    entry = {"removed": 0.1, "views": [{"removed": one} for one in (0.2, 0.0, -0.0, -0.1)]}
    assert "1 of 4 removed some" in told(entry) and "1 added some" in told(entry)
