"""The generator's own frames at the frozen views: of captures and proxy alone, scored as an asset's pictures are."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from small_bundle import FACES, VERTICES, bundle, photographs, splats

from r2sego_blender.captures.capture import DecodedCapture
from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.exposure.exposures import exposures_of
from r2sego_blender.evaluation.generator_score import score_generator, told
from r2sego_blender.geometry.stereo.stereo import DEPTH, DepthMap
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset


@pytest.fixture
def scene(tmp_path):
    """A grey wall over a floor; its captures' depth is the true one."""
    made = bundle(tmp_path, [splats(0.9), splats(0.9)], SplatAsset.empty())
    (made.path / DEPTH.name).mkdir(parents=True)
    for capture in made.read(CAPTURES):
        seen = MeshRasterizer(VERTICES, FACES).render(capture.camera)
        sure = np.zeros(capture.camera.shape, np.float32), np.ones(capture.camera.shape, np.uint8)
        depth = DepthMap(seen.depth, np.zeros((*capture.camera.shape, 3), np.float32), *sure, capture.camera)
        depth.save(made.path / DEPTH.name / f"{capture.name}.npz")
    return made


def frozen(folder, grey):
    views = photographs(folder, (-0.1, 0.2), "frozen")
    for view in views:
        save_image(view.image_path, np.full((*view.camera.shape, 3), grey, np.float32))
    return tuple(map(DecodedCapture.of, views))


def test_its_frames_have_the_captures_colours_whatever_the_assets_show(scene, tmp_path):
    entry = score_generator(scene, frozen(tmp_path, 0.6), exposures_of(scene))
    apart = (153 - 128) / 255.0  # 0.6 and 0.5 in eight bits
    assert entry["psnr"] == pytest.approx(-20.0 * np.log10(apart), abs=0.05)
    assert f"{entry['psnr']:.2f} dB" in told(entry)


def test_they_are_shown_at_the_exposure_of_the_captures_near_a_view(scene, tmp_path):
    """Captures are brought to half their light before anything is made of them; a held-out photograph is not."""
    views = frozen(tmp_path, 0.6)
    plain = score_generator(scene, views, exposures_of(scene))["psnr"]
    darker = tuple(dataclasses.replace(one, gain=(0.5, 0.5, 0.5)) for one in scene.read(CAPTURES))
    assert np.abs(darker[0].image() - 0.5).min() > 0.1
    save_captures(scene.captures_folder, darker)
    assert score_generator(scene, views, exposures_of(scene))["psnr"] == pytest.approx(plain, abs=0.1)


def test_nothing_is_told_of_another_generator_or_without_a_proxy(scene, tmp_path):
    views = frozen(tmp_path, 0.6)
    shutil.rmtree(scene.path / "rounds/1/proxy")
    assert score_generator(scene, views, exposures_of(scene)) == {} and told({}) == ""
