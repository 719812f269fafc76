"""A bundle with recorded depth maps, from their files to the proxy; and the same without them, to the bit."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from box_room import TABLE, lens, render, texture, write_captures
from cameras_file import save_cameras_json
from click.testing import CliRunner
from disturbed_depth import disturbed

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.commands.cli import main
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.geometry.estimators.aligned_depth import ESTIMATED
from r2sego_blender.geometry.proxy.proxy import PROXY, Provenance
from r2sego_blender.geometry.room.completed_depth import COMPLETED, DepthSource
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene

pytestmark = pytest.mark.slow

SMALL = {"stereo.max_side_px": 160, "stereo.iterations": 2, "stereo.levels": 2, "proxy.voxel_m": 0.05}
THINGS = (
    TABLE,
    (np.array([-1.5, 0.6, 0.0]), np.array([-1.0, 1.1, 0.9])),
    (np.array([0.9, 0.3, 0.0]), np.array([1.4, 0.8, 1.3])),
)


def _mostly_bare(points: np.ndarray) -> np.ndarray:
    """The room's texture in patches, grey between them."""
    x, y, z = np.moveaxis(points, -1, 0)
    patch = np.sin(2.2 * x + 1.0) + np.sin(2.7 * y) + np.sin(3.1 * z + 2.0) > 0.8
    return np.where(patch[..., None], texture(points), 0.6)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A furnished, mostly bare room of four photographs, without maps and then with: the bundle, true depth, what
    was completed without, and the digests of that."""
    folder = tmp_path_factory.mktemp("recorded")
    around = np.linspace(-0.8, 0.8, 4)
    places = [np.array([1.6 * np.sin(a), -1.6 * np.cos(a), 1.4]) for a in around]
    cameras = [lens(320, 240).at(look_at(place, [0.0, 0.5, 0.6])) for place in places]
    (folder / "photos").mkdir()
    captures, depths = write_captures(folder / "photos", cameras, boxes=THINGS, colour=_mostly_bare)
    save_cameras_json(folder / "photos" / "cameras.json", captures, metric=True)
    rng = np.random.default_rng(0)
    (folder / "maps").mkdir()
    for capture, depth in zip(captures, depths, strict=True):
        np.save(folder / "maps" / f"{capture.image_path.stem}.npy", disturbed(depth, rng, blur_px=1.4))
    scene = create_scene(
        folder / "room.r2s",
        folder / "photos",
        folder / "photos" / "cameras.json",
        scale=Scale.metric(),
        settings=CaptureSettings(max_side_px=320),
    ).declare(overrides=SMALL)
    refine(scene, until=COMPLETED.name)
    before = scene.read(COMPLETED).of(scene.read(CAPTURES))
    digests = {name: content_digest(scene.path / name) for name in ("scene.toml", COMPLETED.name)}
    _run("estimate-depth", str(scene.path), "--recorded", str(folder / "maps"))
    scene = Scene.open(scene.path)
    refine(scene, until=PROXY.of_round(0).name)
    return scene, [render(camera.fitted(160), THINGS)[1] for camera in cameras], before, digests


def _run(*command: str) -> str:
    done = CliRunner().invoke(main, list(command), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def _right(completed, depths) -> float:
    """The share of pixels within 5 % of the truth."""
    return float(np.mean([np.abs(one.depth / true - 1.0) < 0.05 for one, true in zip(completed, depths, strict=True)]))


def test_what_was_estimated_is_named_and_no_model(made):
    scene, *_ = made
    assert scene.declaration.backends["depth_estimator"] == "recorded depth maps"
    assert "4 of 4" in _run("estimate-depth", str(scene.path))


def test_recorded_depth_of_5_percent_error_completes_ten_points_more(made):
    scene, depths, before, _ = made
    after = scene.read(COMPLETED).of(scene.read(CAPTURES))
    assert _right(after, depths) >= _right(before, depths) + 0.10
    for one, other in zip(before, after, strict=True):
        seen = one.source == DepthSource.OBSERVED
        assert (other.depth[seen & other.seen] == one.depth[seen & other.seen]).all()
        assert (seen & ~other.seen).mean() < 0.01
        assert ((other.certainty > 0.0) == (other.source == DepthSource.ESTIMATED)).all()


def test_the_estimate_lies_within_what_it_says(made):
    scene, depths, *_ = made
    shares = []
    for one, true in zip(scene.read(ESTIMATED).of(scene.read(CAPTURES)), depths, strict=True):
        valid = one.depth > 0.0
        assert valid.mean() > 0.9
        off = np.abs(np.log(one.depth[valid] / true[valid])) / one.sigma[valid]
        shares.append([(off < 1.0).mean(), (off < 2.0).mean()])
    assert (np.mean(shares, axis=0) > [0.6, 0.85]).all()


def test_faces_of_the_proxy_are_called_estimated_with_their_certainty(made):
    scene, *_ = made
    proxy = scene.read(PROXY.of_round(0))
    estimated = proxy.provenance == Provenance.ESTIMATED
    assert estimated.sum() > 50 and (proxy.provenance == Provenance.OBSERVED).sum() > 50
    assert proxy.confidence[estimated].mean() < proxy.confidence[proxy.provenance == Provenance.OBSERVED].mean()


def test_taken_away_everything_is_as_it_was_to_the_bit(made, tmp_path):
    scene, _, _, digests = made
    shutil.copytree(scene.path, tmp_path / "copy.r2s")
    _run("estimate-depth", str(tmp_path / "copy.r2s"), "--remove")
    copy = Scene.open(tmp_path / "copy.r2s")
    refine(copy, until=COMPLETED.name)
    assert {name: content_digest(copy.path / name) for name in digests} == digests
    assert not (copy.path / ESTIMATED.name).exists()


def test_a_second_run_makes_nothing_again(made):
    scene, *_ = made
    stamps = {name: (scene.path / name).stat().st_mtime_ns for name in (ESTIMATED.name, COMPLETED.name)}
    refine(Scene.open(scene.path), until=COMPLETED.name)
    assert {name: (scene.path / name).stat().st_mtime_ns for name in stamps} == stamps
