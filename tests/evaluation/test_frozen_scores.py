"""Scores on frozen views: complete images, means over the views, one file for all arms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.arm_scores import arm_lines
from r2sego_blender.evaluation.frozen import ArmScore, ViewScore, score
from r2sego_blender.evaluation.lpips.weights import WEIGHTS_VARIABLE
from r2sego_blender.evaluation.metrics_file import write_metrics
from r2sego_blender.evaluation.surfaces.surface_scores import ArmFigures


@pytest.fixture(autouse=True)
def _no_lpips_weights(monkeypatch):
    monkeypatch.delenv(WEIGHTS_VARIABLE, raising=False)


@pytest.fixture
def views(tmp_path) -> list[Capture]:
    rng = np.random.default_rng(3)
    made = []
    for index in range(3):
        pose = np.eye(4)
        pose[2, 3] = index
        path = tmp_path / f"view_{index}.png"
        save_image(path, rng.random((24, 32, 3)).astype(np.float32))
        made.append(Capture(f"view_{index}", path, Camera(32, 24, 20.0, 20.0, 16.0, 12.0, pose)))
    return made


def test_a_constant_error_has_the_psnr_of_its_size(views):
    """An error of 51/255 everywhere is 20 log10(5) = 13.98 dB, and no border is cropped."""
    truths = {float(view.camera.centre[2]): view.image() * 0.5 for view in views}
    darker = [Capture(v.name, v.image_path.with_suffix(".half.png"), v.camera) for v in views]
    for view, capture in zip(views, darker, strict=True):
        save_image(capture.image_path, truths[float(view.camera.centre[2])])
    by_place = {float(view.camera.centre[2]): view.image() for view in darker}
    arm = score(lambda camera: by_place[float(camera.centre[2])] + 51 / 255, darker)
    assert arm.psnr == pytest.approx(20 * np.log10(5), abs=1e-5)
    assert [view.name for view in arm.views] == [view.name for view in darker]


def test_scores_are_scikit_images(views):
    """PSNR, and SSIM with the same window, over all pixels, with zeros outside the picture as 3DGS has them."""
    truth = views[0].image().astype(np.float64)
    changed = np.round(255.0 * np.clip(truth + np.random.default_rng(5).normal(0.0, 0.1, truth.shape), 0, 1)) / 255.0
    found = score(lambda _: changed, views[:1])
    assert found.psnr == pytest.approx(peak_signal_noise_ratio(truth, changed, data_range=1.0), abs=1e-5)
    framed = [
        np.pad(picture, ((10, 10), (10, 10), (0, 0))) for picture in (changed, truth)
    ]  # beyond the window's reach
    _, everywhere = structural_similarity(
        *framed,
        channel_axis=2,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1.0,
        full=True,
    )
    assert found.ssim == pytest.approx(everywhere[10:-10, 10:-10].mean(), abs=1e-5)


def test_an_error_in_one_corner_pixel_counts(views):
    truth = views[0].image()
    changed = truth.copy()
    changed[0, 0] = 1.0 - np.round(changed[0, 0])
    arm = score(lambda _: changed, views[:1])
    expected = -10 * np.log10(np.mean((np.round(changed * 255) / 255 - truth) ** 2))
    assert arm.psnr == pytest.approx(expected, abs=1e-4)
    assert arm.ssim < 1.0


def test_means_are_over_views_and_renderings_are_kept_as_scored(views):
    kept = {}
    arm = score(lambda camera: np.full((24, 32, 3), 0.3333), views, keep=kept.__setitem__)
    assert arm.psnr == pytest.approx(np.mean([view.psnr for view in arm.views]))
    assert arm.ssim == pytest.approx(np.mean([view.ssim for view in arm.views]))
    assert set(kept) == {"view_0", "view_1", "view_2"}
    assert np.allclose(kept["view_0"] * 255, 85)


def test_without_weights_lpips_is_none_and_says_why(views):
    arm = score(lambda camera: np.zeros((24, 32, 3)), views)
    assert arm.lpips_alex is None
    assert all(view.lpips_alex is None for view in arm.views)
    assert "AlexNet weights not at hand" in arm.lpips_reason


def test_lpips_is_of_each_view_and_its_mean_of_all(views):
    class Difference:
        def distance(self, rendering, truth):
            return float(np.abs(rendering - truth).mean())

    arm = score(lambda camera: np.zeros((24, 32, 3)), views, lpips=Difference())
    means = [float(view.image().mean()) for view in views]
    assert [view.lpips_alex for view in arm.views] == pytest.approx(means)
    assert (arm.lpips_alex, arm.lpips_reason) == (pytest.approx(np.mean(means)), "")


def test_wrong_sizes_and_no_views_are_refused(views):
    with pytest.raises(CaptureError, match="shape"):
        score(lambda camera: np.zeros((12, 16, 3)), views)
    with pytest.raises(CaptureError, match="no frozen views"):
        score(lambda camera: np.zeros((24, 32, 3)), [])


def arm(offset: float) -> ArmScore:
    views = tuple(ViewScore(f"frozen_{i:02d}", 20 + offset + i, 0.7123456789, None) for i in (1, 0))
    return ArmScore(20.5 + offset, 0.7123456789, None, views, "AlexNet weights not at hand")


def test_the_metrics_file_has_the_documented_shape(tmp_path):
    path = tmp_path / "metrics.json"
    write_metrics(path, {"vanilla_3dgs": arm(0.0), "initial": arm(1.0), "refined": arm(2.0)})
    document = json.loads(path.read_text())
    assert list(document) == ["arms"]
    assert list(document["arms"]) == ["initial", "refined", "vanilla_3dgs"]
    refined = document["arms"]["refined"]
    assert refined["psnr"] == 22.5
    assert refined["ssim"] == 0.7123
    assert refined["lpips_alex"] is None
    assert refined["lpips_reason"] == "AlexNet weights not at hand"
    assert refined["views"] == [
        {"name": "frozen_00", "psnr": 22.0, "ssim": 0.7123},
        {"name": "frozen_01", "psnr": 23.0, "ssim": 0.7123},
    ]


def test_the_metrics_file_is_the_same_bytes_for_any_order(tmp_path):
    a, b = tmp_path / "a.json", tmp_path / "b.json"
    write_metrics(a, {"initial": arm(0.0), "refined": arm(1.0)})
    write_metrics(b, {"refined": arm(1.0), "initial": arm(0.0)})
    assert a.read_bytes() == b.read_bytes()
    assert not list(tmp_path.glob("*.part"))


def test_further_parts_stand_beside_the_arms(tmp_path):
    path = tmp_path / "metrics.json"
    rounds = [{"round": 0, "psnr": 22.5, "ssim": 0.7}]
    written = write_metrics(path, {"refined": arm(0.0)}, rounds=rounds, causes={"unavailable": "no proxy"})
    assert json.loads(path.read_text()) == written
    assert written["rounds"] == rounds and set(written) == {"arms", "rounds", "causes"}
    assert written["arms"]["refined"]["psnr"] == 20.5


def test_what_surfaces_tell_stands_in_the_arms_and_their_views(tmp_path):
    figures = ArmFigures({"psnr_seen": 21.0, "seen_by": "a mesh"}, {f"frozen_0{i}": {"unseen": i} for i in (0, 1)})
    written = write_metrics(tmp_path / "a.json", {"refined": arm(0.0), "initial": arm(1.0)}, {"refined": figures})
    refined = written["arms"]["refined"]
    assert (refined["psnr_seen"], refined["seen_by"], refined["psnr"]) == (21.0, "a mesh", 20.5)
    assert [view["unseen"] for view in refined["views"]] == [0, 1]
    assert "psnr_seen" not in written["arms"]["initial"]


def test_colours_are_corrected_where_it_is_asked_for_and_beside_the_score(views, tmp_path):
    by_place = {float(view.camera.centre[2]): 0.5 * view.image() + 0.1 for view in views}
    plain, both = (
        score(lambda camera: by_place[float(camera.centre[2])], views, corrected=asked) for asked in (False, True)
    )
    assert plain.psnr_corrected is None and both.psnr == plain.psnr < 20.0
    assert both.psnr_corrected > 40.0
    assert both.psnr_corrected == pytest.approx(np.mean([view.psnr_corrected for view in both.views]))
    written = write_metrics(tmp_path / "a.json", {"refined": both, "initial": plain})["arms"]
    assert written["refined"]["psnr_corrected"] == pytest.approx(both.psnr_corrected, abs=1e-3)
    assert all("psnr_corrected" in view for view in written["refined"]["views"])
    assert "psnr_corrected" not in written["initial"]
    head, initial, refined = arm_lines(written)
    assert "cc dB" in head and f"{both.psnr_corrected:.2f}" in refined and "-" in initial
    assert "cc dB" not in arm_lines({"initial": written["initial"]})[0]


def test_equal_images_are_no_invalid_json(tmp_path):
    perfect = ArmScore(float("inf"), 1.0, 0.0, (ViewScore("v", float("inf"), 1.0, 0.0),))
    path = tmp_path / "metrics.json"
    write_metrics(path, {"refined": perfect})
    refined = json.loads(path.read_text())["arms"]["refined"]
    assert refined["psnr"] is None and refined["views"][0]["psnr"] is None
    assert (refined["ssim"], refined["lpips_alex"]) == (1.0, 0.0)
