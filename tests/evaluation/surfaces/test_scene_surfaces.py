"""A bundle against the true room: regions, depth and surfaces are scored where the truth is known, and say by what."""

from __future__ import annotations

import numpy as np
import pytest
from small_bundle import FACES, HEIGHT, VERTICES, WIDTH, bundle, photographs, splats

from r2sego_blender.evaluation.surfaces import scene_surfaces, surface_scores
from r2sego_blender.evaluation.surfaces.figures import (
    PROXY_ALONE,
    SURFACE_KINDS,
    TRUE_ROOM,
    geometry_lines,
    unseen_told,
)
from r2sego_blender.evaluation.surfaces.scene_surfaces import surfaces_of
from r2sego_blender.evaluation.surfaces.surface_scores import arm_figures, geometry_figures
from r2sego_blender.geometry.collision.collision_files import obj_text
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset

LIFTED = VERTICES + np.array([0.0, 0.03, 0.0])  # 3 cm behind, within what an F-score takes for one


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.setattr(surface_scores, "FOUND_SAMPLES", 30_000)
    monkeypatch.setattr(scene_surfaces, "TRUE_SAMPLES", 30_000)
    made = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    made.collision_folder.mkdir()
    (made.collision_folder / "mesh.obj").write_text(obj_text(LIFTED, FACES))
    return made


@pytest.fixture
def views(tmp_path):
    return photographs(tmp_path, (0.0, 2.5), "frozen")  # the second looks past what captures saw


def save_truth(folder, vertices):
    np.savez(folder / "room.npz", V=vertices, F=FACES, I=np.zeros(len(FACES), np.int64), names=np.array(["room"]))


def test_with_the_true_room_all_is_scored(scene, views, tmp_path):
    save_truth(tmp_path, VERTICES)
    surfaces = surfaces_of(scene, tmp_path / "cameras.json", views)
    assert surfaces.told_by == TRUE_ROOM and not surfaces.note
    truth = [MeshRasterizer(VERTICES, FACES).render(view.camera).depth for view in views]
    for view, depth in zip(surfaces.views, truth, strict=True):
        np.testing.assert_array_equal(view.true_depth, depth)
    images = [
        view.image() + np.where(surface.seen, 0.1, 0.2)[..., None]
        for view, surface in zip(views, surfaces.views, strict=True)
    ]
    off = [np.where(np.arange(WIDTH) < WIDTH // 2, 1.02, 1.1) * depth for depth in truth]
    found = arm_figures(surfaces, views, images, off)
    assert found.whole["psnr_seen"] == pytest.approx(20.0, abs=1e-3)
    assert found.whole["psnr_unseen"] == pytest.approx(-20 * np.log10(0.2), abs=1e-3)
    assert found.whole["unseen"] == pytest.approx(np.mean([~view.seen for view in surfaces.views]), abs=1e-4)
    assert 0.3 < found.views["frozen_1"]["unseen"] < 1.0 and "psnr_unseen" not in found.views["frozen_0"]
    assert found.whole["depth_error"] == pytest.approx(0.06, abs=1e-3)  # between 2 and 10 %
    assert found.whole["depth_right"] == found.views["frozen_1"]["depth_right"] == pytest.approx(0.5)
    assert found.whole["seen_by"] == TRUE_ROOM

    geometry = geometry_figures(scene, surfaces)
    assert geometry["proxy_depth_error"] == 0.0 and geometry["proxy_depth_right"] == 1.0
    assert set(SURFACE_KINDS) <= set(geometry)
    assert geometry["proxy_fscore"] == pytest.approx(1.0, abs=0.05) and geometry["collision_precision"] == 1.0
    told = geometry_lines({**found.whole, **geometry})
    assert len(told) == 4 and f"F-score {geometry['proxy_fscore']:.3f}" in told[2]

    (scene.collision_folder / "mesh.obj").unlink()
    without = geometry_figures(scene, surfaces)
    assert without["proxy_fscore"] == geometry["proxy_fscore"]
    assert not [kind for kind in without if kind.startswith("collision")]


def test_without_the_true_room_regions_are_told_by_the_proxy_and_geometry_is_not_scored(scene, views, tmp_path):
    surfaces = surfaces_of(scene, tmp_path / "cameras.json", views)
    assert surfaces.told_by == PROXY_ALONE and surfaces.true is None and not geometry_figures(scene, surfaces)
    found = arm_figures(surfaces, views, [view.image() for view in views], [np.ones((HEIGHT, WIDTH))] * 2)
    assert found.whole["psnr_seen"] is None  # equal images
    assert "depth_error" not in found.whole and "approximate" in unseen_told(found.whole)

    save_truth(tmp_path, VERTICES)
    truly = surfaces_of(scene, tmp_path / "cameras.json", views)
    for one, other in zip(surfaces.views, truly.views, strict=True):
        np.testing.assert_array_equal(one.seen, other.seen)  # the proxy is right here
