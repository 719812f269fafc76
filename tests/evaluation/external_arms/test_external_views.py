"""Methods of others in environments of their own: what they are given, what comes back, what is said without them."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from cameras_file import save_cameras_json
from hypothesis import given
from hypothesis import strategies as st
from progress_recorder import ProgressRecorder
from scipy.spatial.transform import Rotation
from small_bundle import bundle, photographs, splats
from stand_in_methods import write_difix3d, write_genfusion

from r2sego_blender.bundle import layout
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import load_captures
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import EvaluationError, MachineError, NativeError
from r2sego_blender.core.images import save_image, to_uint8
from r2sego_blender.evaluation import arm_scores, scene_evaluation, scene_report
from r2sego_blender.evaluation.arms import ARMS, DIFIX3D_PLUS, GAUSSGYM, GENFUSION, REFINED
from r2sego_blender.evaluation.exposure.exposures import Exposures, exposures_of
from r2sego_blender.evaluation.external_arms import difix3d_plus, external_views
from r2sego_blender.evaluation.external_arms import genfusion as genfusion_arm
from r2sego_blender.evaluation.external_arms.external_views import METHODS, ExternalViews
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.evaluation.report_data import Round
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.splats.formats.ply import load_made, save_ply
from r2sego_blender.workers.models import genfusion

ONE_GREY = 1.5 / 255.0  # rounded twice, and resized


@pytest.fixture(autouse=True)
def nothing_set_up(monkeypatch, tmp_path):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "nothing"))
    for known in (difix3d_plus.BACKEND, genfusion_arm.BACKEND):
        monkeypatch.delenv(known.variable, raising=False)
    monkeypatch.delenv(genfusion_arm.REPOSITORY_VARIABLE, raising=False)
    monkeypatch.delenv(genfusion_arm.CHECKPOINT_VARIABLE, raising=False)


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A refined bundle with observed points of its first capture, and a GaussGym condition of one grey."""
    made = bundle(tmp_path, [splats(0.6)], splats(0.6))
    save_ply(made.asset_file, splats(0.6))
    rng = np.random.default_rng(0)
    points = rng.uniform((-1, 2, 0), (1, 2.1, 2), (20, 3)).astype(np.float32)
    normals = np.tile(np.float32([0, -1, 0]), (20, 1))
    colours = rng.random((20, 3), np.float32)
    visibility = np.tile([True, False], (20, 1))  # the second capture sees none
    observed = ObservedGeometry(points, normals, colours, visibility, np.ones(20, np.float32))
    observed.save(made.path / layout.OBSERVED)

    def train(scene, progress, arms):
        if GAUSSGYM in arms:
            (scene.path / "report").mkdir(exist_ok=True)
            save_ply(scene.path / ARMS[GAUSSGYM].asset, splats(0.9))

    monkeypatch.setattr(arm_scores, "train_arms", train)
    monkeypatch.setattr(scene_report, "_round", lambda scene, index, influence: Round(index))
    return made


@pytest.fixture
def frozen(tmp_path):
    views = photographs(tmp_path, (-0.1, 0.3), "frozen")
    save_cameras_json(tmp_path / "cameras.json", views)
    cameras = json.loads((tmp_path / "cameras.json").read_text(encoding="utf-8"))
    (tmp_path / "cameras.json").write_text(json.dumps(cameras | {"frozen": cameras["captures"]}))
    return tmp_path / "cameras.json"


@pytest.fixture
def with_difix3d(tmp_path, monkeypatch):
    folder = write_difix3d(tmp_path / "difix3d")
    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.setenv(difix3d_plus.BACKEND.variable, sys.executable)
    return folder


@pytest.fixture
def with_genfusion(tmp_path, monkeypatch):
    repository = write_genfusion(tmp_path / "genfusion")
    monkeypatch.setenv(genfusion_arm.BACKEND.variable, sys.executable)
    monkeypatch.setenv(genfusion_arm.REPOSITORY_VARIABLE, str(repository))
    return repository


def test_every_arm_of_pictures_has_its_method_and_begins_with_an_arm_that_has_an_asset():
    assert set(METHODS) == {arm for arm, source in ARMS.items() if source.views}
    assert all(bool(source.asset) != bool(source.views) for source in ARMS.values())
    assert all(ARMS[source.base].asset for source in ARMS.values() if source.base)


@pytest.mark.parametrize("arm", METHODS)
def test_without_its_environment_an_arm_is_named_with_what_is_missing_and_the_others_are_scored(arm, scene, frozen):
    recorder = ProgressRecorder()
    metrics = scene_evaluation.evaluate_scene(scene, frozen, recorder, arms=(arm,))
    assert set(metrics["arms"]) == {REFINED} and set(metrics["not_scored"]) == {arm}
    variable = METHODS[arm].BACKEND.variable
    assert variable in metrics["not_scored"][arm]
    (warning,) = [text for level, text in recorder.messages if level == "warning" and variable in text]
    assert warning in scene_evaluation.table(metrics)
    assert not (scene.path / ARMS[GAUSSGYM].asset).exists()  # nothing is trained for what cannot be asked


def test_difix3d_plus_fixes_the_gaussgym_conditions_pictures_with_the_nearest_capture(scene, frozen, with_difix3d):
    metrics = scene_evaluation.evaluate_scene(scene, frozen, arms=(DIFIX3D_PLUS,))
    assert set(metrics["arms"]) == {DIFIX3D_PLUS, REFINED} and not metrics["not_scored"]
    told = metrics["arms"][DIFIX3D_PLUS]
    assert told["backend"].startswith("Difix3D+ (nvidia/difix_ref), weights ")
    assert told["backend"] in (scene.report_folder / "index.html").read_text(encoding="utf-8")
    assert "depth_error" not in told and "psnr_seen" in told

    captures = load_captures(scene.captures_folder)
    shown = Exposures(captures).renderer(load_made(scene.path / ARMS[GAUSSGYM].asset))
    views = frozen_views(scene, frozen).views
    made = ExternalViews.load(scene.path / ARMS[DIFIX3D_PLUS].views)
    for view, nearest in zip(views, (0, 1), strict=True):
        mixed = 0.5 * np.clip(shown(view.camera).colour, 0.0, 1.0) + 0.5 * captures[nearest].image()
        inner = (slice(2, -2), slice(2, -2))  # enlarging rings at the edges of what is not one grey
        np.testing.assert_allclose(made.pictures[view.name][inner], mixed[inner], atol=0.03)


def test_genfusion_is_given_cameras_and_points_and_no_photograph_of_a_view(scene, frozen, with_genfusion):
    metrics = scene_evaluation.evaluate_scene(scene, frozen, arms=(GENFUSION,))
    assert not metrics["not_scored"], metrics["not_scored"]
    assert metrics["arms"][GENFUSION]["backend"].startswith("GenFusion (epoch=59-step=34000.ckpt), weights ")
    made = ExternalViews.load(scene.path / ARMS[GENFUSION].views)
    for view in frozen_views(scene, frozen).views:
        camera = view.camera
        v, u = np.mgrid[: camera.height, : camera.width] + 0.5
        blue = np.full(camera.shape, camera.centre @ (0.3, 0.2, 0.1))
        expected = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, blue], axis=-1)
        np.testing.assert_allclose(made.pictures[view.name], np.clip(0.5 + 0.5 * expected, 0.0, 1.0), atol=ONE_GREY)


def test_what_was_shown_is_asked_again_only_where_something_changed(scene, frozen, with_genfusion, monkeypatch):
    views = frozen_views(scene, frozen).views
    first = external_views.external_views(scene, GENFUSION, views, exposures_of(scene))
    monkeypatch.setattr(external_views, "ask", None)  # whoever asks now fails
    again = external_views.external_views(scene, GENFUSION, views, exposures_of(scene))
    assert all((again.pictures[name] == picture).all() for name, picture in first.pictures.items())
    (with_genfusion / genfusion.FOLDER / "train.py").write_text("raise SystemExit(3)")
    with pytest.raises(TypeError):
        external_views.external_views(scene, GENFUSION, views, exposures_of(scene))


def test_a_method_that_breaks_costs_its_own_arm_alone_and_is_told_with_its_last_words(scene, frozen, with_genfusion):
    (with_genfusion / genfusion.FOLDER / "train.py").write_text("raise SystemExit('no CUDA here')")
    metrics = scene_evaluation.evaluate_scene(scene, frozen, arms=(GENFUSION,))
    assert "no CUDA here" in metrics["not_scored"][GENFUSION] and REFINED in metrics["arms"]
    assert not (scene.path / ARMS[GENFUSION].views).exists()


def test_weights_that_are_not_there_are_named(scene, frozen, with_difix3d, with_genfusion):
    (with_difix3d / "huggingface_hub" / "weights.bin").unlink()
    (with_genfusion / genfusion.FOLDER / genfusion.CHECKPOINT).unlink()
    views = frozen_views(scene, frozen).views
    arm_scores.train_arms(scene, ProgressRecorder(), (GAUSSGYM,))
    with pytest.raises(MachineError, match="nvidia/difix_ref"):
        external_views.external_views(scene, DIFIX3D_PLUS, views, exposures_of(scene))
    with pytest.raises(MachineError) as error:
        external_views.external_views(scene, GENFUSION, views, exposures_of(scene))
    assert error.value.where.endswith(genfusion.CHECKPOINT)


def test_a_machine_without_a_gpu_is_told_so(scene, frozen, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(write_difix3d(tmp_path / "difix3d", gpu=False)))
    monkeypatch.setenv(difix3d_plus.BACKEND.variable, sys.executable)
    metrics = scene_evaluation.evaluate_scene(scene, frozen, arms=(DIFIX3D_PLUS,))
    assert "GPU" in metrics["not_scored"][DIFIX3D_PLUS]


def test_pictures_of_another_size_are_refused(scene, frozen, with_genfusion):
    render = with_genfusion / genfusion.FOLDER / "render.py"
    render.write_text(render.read_text().replace(".save(shown / name)", '.save(shown / ("x" + name))'))
    with pytest.raises(NativeError):
        views = frozen_views(scene, frozen).views
        external_views.external_views(scene, GENFUSION, views, exposures_of(scene))


def test_pictures_are_kept_with_their_names_and_their_backend(tmp_path):
    rng = np.random.default_rng(3)
    pictures = {
        name: to_uint8(rng.random((*shape, 3))) / np.float32(255.0) for name, shape in (("b", (4, 6)), ("a", (5, 3)))
    }
    ExternalViews("a model", "0" * 64, pictures).save(tmp_path / "views.npz")
    found = ExternalViews.load(tmp_path / "views.npz")
    assert (found.backend, found.weights, [*found.pictures]) == ("a model", "0" * 64, ["b", "a"])
    assert all((found.pictures[name] == picture).all() for name, picture in pictures.items())
    (tmp_path / "views.npz").write_bytes(b"no archive")
    with pytest.raises(EvaluationError):
        ExternalViews.load(tmp_path / "views.npz")


def test_the_nearest_capture_is_told_by_metres_and_radians_together(tmp_path):
    save_image(tmp_path / "grey.png", np.zeros((8, 8, 3), np.float32))

    def at(x: float, turned_rad: float) -> Camera:
        way = np.array([np.sin(turned_rad), np.cos(turned_rad), 0.0])
        return Camera(8, 8, 8.0, 8.0, 4.0, 4.0, look_at((x, 0.0, 1.0), np.array([x, 0.0, 1.0]) + way))

    captures = [Capture(f"{k}", tmp_path / "grey.png", one) for k, one in enumerate([at(0.0, 1.0), at(0.9, 0.0)])]
    assert difix3d_plus.nearest(at(0.0, 0.0), captures) == 1
    captures[1] = replace(captures[1], camera=at(1.1, 0.0))
    assert difix3d_plus.nearest(at(0.0, 0.0), captures) == 0


def test_in_as_many_steps_as_published_its_settings_are_the_published_ones():
    told = genfusion.options_of(7000, 6)
    published = {
        "iterations": 7000,
        "start_diffusion_iter": 1000,
        "sparse_view": 6,
        "diffusion_until": 7000,
        "diffusion_every": 1000,
        "densify_until_iter": 5000,
        "densification_interval": 500,
        "opacity_reset_interval": 3100,
        "lambda_dist": 10.0,
        "unconditional_guidance_scale": 3.2,
    }
    assert {f"--{name}": str(value) for name, value in published.items()}.items() <= told.items()
    longer = genfusion.options_of(14000, 6)
    assert (longer["--diffusion_every"], longer["--densification_interval"]) == ("2000", "500")


@given(st.tuples(st.integers(16, 2000), st.integers(16, 2000)), st.tuples(st.integers(16, 2000), st.integers(16, 2000)))
def test_enlarged_pictures_hold_the_cut_and_none_is_made_smaller(one, other):
    sizes = np.array([one, other])
    larger = np.ceil(sizes * genfusion.enlargement(sizes) - 1e-6)
    assert (larger >= np.array(genfusion.LEAST_PX)).all() and (larger >= sizes).all()


def test_colmap_reads_the_model_that_is_written_for_genfusion(tmp_path):
    rng = np.random.default_rng(5)
    sizes, lenses = np.array([(960, 720), (1280, 544)]), rng.uniform(200.0, 700.0, (2, 4))
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, :3] = Rotation.random(2, random_state=6).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(2, 3))
    points, colours = rng.normal(size=(4, 3)), rng.integers(0, 256, (4, 3), np.uint8)
    visibility = np.array([(True, False), (True, True), (False, False), (False, True)])
    names, folder = ["a.png", "b.png"], tmp_path / "model"
    genfusion.write_model(folder, names, sizes, lenses, poses, points, colours, visibility)
    read = pycolmap.Reconstruction(str(folder))
    for index, name in enumerate(("a.png", "b.png")):
        image = read.images[index + 1]
        assert image.name == name and (image.camera.width, image.camera.height) == tuple(sizes[index])
        np.testing.assert_array_equal(image.camera.params, lenses[index])
        pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
        np.testing.assert_allclose(pose.matrix(), poses[index, :3], atol=1e-12)
    assert sorted(read.points3D) == [1, 2, 4]  # what none sees is left out
    for number, point in read.points3D.items():
        np.testing.assert_array_equal(point.xyz, points[number - 1])
        np.testing.assert_array_equal(point.color, colours[number - 1])
        elements = point.track.elements
        assert {one.image_id for one in elements} == set(np.flatnonzero(visibility[number - 1]) + 1)
        for one in elements:
            image = read.images[one.image_id]
            measured = image.points2D[one.point2D_idx]
            assert measured.point3D_id == number
            if (projected := image.project_point(point.xyz)) is not None:
                np.testing.assert_allclose(measured.xy, projected)
