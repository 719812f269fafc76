"""VGGT as the registrar: its relative pose composed with the reference's, refined and judged as any frame's."""

import json
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import box_room
import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.presets import with_overrides
from r2sego_blender.config.settings import RegistrationSettings, Settings
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad
from r2sego_blender.core.errors import MachineError, NativeError
from r2sego_blender.core.images import save_image
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.ego_views import ego_video_reg
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.registration.frame_registration import register_frame
from r2sego_blender.generation.registration.landmarks import Landmarks
from r2sego_blender.generation.registration.pnp import PnPRegistrar
from r2sego_blender.generation.registration.registry import open_registrar, registrar_installation
from r2sego_blender.generation.registration.vggt import VGGTRegistrar
from r2sego_blender.views.references import with_references
from r2sego_blender.views.selection import select_targets
from r2sego_blender.workers.protocol.program_worker import ProgramWorker
from r2sego_blender.workers.protocol.recorded_worker import RecordedWorker
from r2sego_blender.workers.protocol.serving import RANDOM, Answer, write_answer
from tools.benchmarks.truth.disturbance import disturbed_pose
from tools.benchmarks.truth.drifting_vggt import BACKEND, record_drifting

REFERENCE = 1


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """The box room photographed at 320 x 240, and a target between two captures."""
    captures, depths = box_room.write_captures(tmp_path_factory.mktemp("room"), box_room.arc(4, 320, 240))
    target = box_room.lens(320, 240).at(look_at([0.1, -1.5, 1.3], [0.0, 0.5, 0.6]))
    return SimpleNamespace(
        captures=captures,
        depths=depths,
        target=target,
        landmarks=Landmarks.build(captures, depths),
        renderer=ZBufferRenderer(box_room.proxy()),
    )


def off(camera, seed, metres=0.05, degrees=3.0):
    return camera.at(disturbed_pose(camera.world_from_camera, np.random.default_rng(seed), metres, degrees))


def error_of(estimate, truth):
    """Metres and degrees."""
    turn = rotation_angle_rad(estimate.world_from_camera, truth.world_from_camera)
    return np.linalg.norm(estimate.centre - truth.centre), np.degrees(turn)


def asked_cameras(room, query, truth):
    """The true cameras of what VGGT is shown of a frame, in its order."""
    captures, fixed = room.captures, room.captures[REFERENCE].camera
    seen = room.landmarks.indices_seen_best(query, fixed, RegistrationSettings().max_captures)
    return [fixed, truth, *(captures[index].camera for index in seen if index != REFERENCE)]


def recorded(folder, room, query, truth, seed=0, **drift):
    rng = np.random.default_rng(seed)
    record_drifting(folder, asked_cameras(room, query, truth), room.depths[REFERENCE], rng, **drift)
    return RecordedWorker(folder)


def registrar_of(room, worker):
    return VGGTRegistrar(worker, room.captures, RegistrationSettings().max_captures)


def answered(folder, **changes):
    """The recorded response in ``folder`` with other outputs, weights or none of an output."""
    response = folder / "registration"
    record = json.loads((response / "response.json").read_text())
    outputs = {name: np.load(response / one["file"]) for name, one in record["outputs"].items()}
    weights = changes.pop("weights", "")
    outputs |= {name: change(outputs[name]) for name, change in changes.items()}
    write_answer(response, "registration", Answer(BACKEND, weights, outputs), time.monotonic())


def test_the_relative_pose_is_scaled_by_the_references_depth_and_composed_with_its_pose(tmp_path):
    """Numbers by hand: VGGT's unit is half a metre, and its world is not the reference's frame."""
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x to y
    fixed = Camera(518, 392, 400.0, 400.0, 259.0, 196.0, np.eye(4))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned, (1.0, 2.0, 3.0)
    fixed = fixed.at(pose)
    grey = np.random.default_rng(0).random((392, 518, 3), np.float32)
    save_image(tmp_path / "grey.png", grey)
    captures = [Capture("grey", tmp_path / "grey.png", fixed)]
    landmarks = Landmarks.build(captures, [np.full(fixed.shape, 2.0, np.float32)])

    reference, frame = np.eye(4)[:3], np.eye(4)[:3]
    reference[:, 3] = (0.2, 0.0, 0.0)
    frame[:, :3], frame[:, 3] = turned, (0.0, 0.0, -1.0)
    maps = np.full((2, 392, 518), 4.0, np.float32)
    matrix = np.repeat([[[300.0, 0, 259], [0, 300, 196], [0, 0, 1]]], 2, axis=0)  # another focal length
    (tmp_path / "registration").mkdir()
    outputs = {
        "depth": maps,
        "confidence": maps,
        "intrinsics": matrix,
        "camera_from_world": np.stack([reference, frame]),
    }
    write_answer(tmp_path / "registration", "registration", Answer("VGGT", "a" * 64, outputs), time.monotonic())

    query = fixed.at(np.eye(4))
    start = VGGTRegistrar(RecordedWorker(tmp_path), captures, 6).start(grey, query, 0, landmarks)
    # The frame stands at (0.2, 0, 1) of the reference, turned by -90 degrees about its axis: in metres half of it.
    np.testing.assert_allclose(start.centre, [1.0, 2.1, 3.5], atol=1e-6)
    np.testing.assert_allclose(start.world_from_camera[:3, :3], np.eye(3), atol=1e-9)
    assert (start.fx, start.width) == (query.fx, query.width)


@pytest.mark.parametrize("seed", range(4))
def test_a_drift_is_corrected_as_well_as_the_embedded_registrar_does(tmp_path, room, seed):
    query = off(room.target, 10 + seed)
    image, _ = box_room.render(room.target)
    worker = recorded(tmp_path, room, query, room.target, seed)
    registrar = registrar_of(room, worker)
    start = registrar.start(image, query, REFERENCE, room.landmarks)
    assert registrar.name == BACKEND
    assert error_of(start, room.target) == (pytest.approx(0.05, abs=0.005), pytest.approx(3.0, abs=0.01))
    fixed = room.captures[REFERENCE].camera
    by_vggt, embedded = (
        register_frame(image, query, fixed, room.landmarks, RegistrationSettings(), 0, one) for one in (start, None)
    )
    for frame in (by_vggt, embedded):
        assert frame.camera is not None, frame.reason
        metres, degrees = error_of(frame.camera, room.target)
        assert metres < 0.006 and degrees < 0.3
    assert frame.offset_m == pytest.approx(by_vggt.offset_m, abs=0.004)  # of the query, whoever was asked


def test_the_unit_is_found_where_much_of_the_depth_is_wrong(tmp_path, room):
    image, _ = box_room.render(room.target)
    worker = recorded(tmp_path, room, room.target, room.target, drift_m=0.0, drift_deg=0.0)

    def spoilt(depth):
        depth[0, :, : depth.shape[2] // 3] *= 3.0
        return depth

    answered(tmp_path, depth=spoilt)
    start = registrar_of(room, worker).start(image, room.target, REFERENCE, room.landmarks)
    assert error_of(start, room.target)[0] < 0.02


def mirrored(poses):
    poses[1, :, 0] *= -1.0
    return poses


def far(poses):
    poses[1, :, 3] += 1e6
    return poses


WRONG = {
    "no number": ({"depth": lambda maps: maps * np.nan}, "no numbers"),
    "another size": ({"depth": lambda maps: maps[:, ::2]}, "gave depth as"),
    "fewer": ({"camera_from_world": lambda poses: poses[:1]}, "gave camera_from_world as"),
    "mirrored": ({"camera_from_world": mirrored}, "not a rotation and a translation"),
    "scaled": ({"camera_from_world": lambda poses: 1.5 * poses}, "not a rotation and a translation"),
    "far": ({"camera_from_world": far}, "from its reference"),
    "behind": ({"depth": lambda maps: -maps}, "knows no depth"),
    "of another place": (
        {"depth": lambda maps: np.random.default_rng(0).uniform(0.1, 9.0, maps.shape).astype(np.float32)},
        "off by",
    ),
    "of random weights": ({"weights": RANDOM}, "random weights"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_answer_that_is_none_is_refused_and_says_whose(tmp_path, room, name):
    changes, says = WRONG[name]
    worker = recorded(tmp_path, room, room.target, room.target)
    answered(tmp_path, **changes)
    with pytest.raises(NativeError, match=says) as caught:
        registrar_of(room, worker).start(room.captures[REFERENCE].image(), room.target, REFERENCE, room.landmarks)
    assert str(tmp_path) in str(caught.value)


SETTINGS = with_overrides(
    {
        "selection.target_views": 1,
        "generation.clip_frames": 2,
        "generation.clip_scale": 0.25,
        "generation.max_replacements": 1,
        "registration.registrar": "vggt",
    }
)


class OneAfterTheOther:
    """A worker that is another one at each request."""

    name, cure = "in turn", ""

    def __init__(self, *workers):
        self.left, self.closed = list(workers), 0

    def answer(self, request, response, tell, limits):
        self.left.pop(0).answer(request, response, tell, limits)

    def close(self):
        self.closed += 1


def ego_views(room, folder, registrar, settings=SETTINGS):
    candidates = [room.target, room.target.at(look_at([-0.2, -1.5, 1.2], [0.0, 0.5, 0.6]))]
    selection = select_targets(np.array([0.8, 0.7]), np.ones(2), np.arange(2), np.zeros(2), settings.selection)
    cameras = [capture.camera for capture in room.captures]
    selection = with_references(selection, candidates, cameras, room.renderer.depth, settings.selection, 2)
    selection = replace(selection, reference=np.full_like(selection.reference, REFERENCE))
    generator = BlendingGenerator(room.captures, room.depths, settings.generation)
    folder.mkdir()
    made = ego_video_reg(
        selection,
        candidates,
        room.captures,
        room.renderer,
        generator,
        room.landmarks,
        settings,
        folder,
        registrar=registrar,
    )
    records = [json.loads(file.read_text()) for file in sorted(folder.glob("*/pose.json"))]
    return made, records, candidates


def test_a_worker_that_dies_costs_its_view_and_is_named(tmp_path, room):
    dying = ProgramWorker([sys.executable, "-c", "input(); print('no room left'); raise SystemExit(3)"], "VGGT", "")
    second = room.target.at(look_at([-0.2, -1.5, 1.2], [0.0, 0.5, 0.6]))
    worker = OneAfterTheOther(dying, recorded(tmp_path / "answers", room, second, second))
    try:
        made, (first, kept), _ = ego_views(room, tmp_path / "views", registrar_of(room, worker))
    finally:
        dying.close()
    assert not first["accepted"] and first["estimate"] is None and first["registrar"] == "VGGT"
    assert "not registered" in first["reason"] and "exit status 3" in first["reason"]
    assert [view.rank for view in made] == [1] and kept["registrar"] == BACKEND in kept["reason"]
    assert error_of(Camera.from_json(kept["start"]), second)[0] == pytest.approx(0.05, abs=0.005)
    assert error_of(made[0].camera, second)[0] < 0.01


def test_a_pose_too_far_off_to_be_corrected_is_refused_by_name(tmp_path, room):
    worker = OneAfterTheOther(
        *(recorded(tmp_path / str(k), room, room.target, room.target, drift_m=0.5, drift_deg=25.0) for k in range(2))
    )
    made, records, _ = ego_views(room, tmp_path / "views", registrar_of(room, worker))
    assert made == ()
    for record in records:
        assert record["reason"].startswith("rejected: ") and BACKEND in record["reason"]


def test_the_embedded_registrars_views_tell_nothing_new(tmp_path, room):
    """Bundles stay as they were to the bit."""
    made, (record, *_), (query, _) = ego_views(room, tmp_path / "views", PnPRegistrar(), Settings())
    assert {"registrar", "start"}.isdisjoint(record) and record["reason"].endswith("patches agree")
    fixed, image = room.captures[REFERENCE].camera, made[0].image
    alone, about_query = (
        register_frame(image, query, fixed, room.landmarks, RegistrationSettings(), 0, start) for start in (None, query)
    )
    for frame in (alone, about_query):
        assert frame.camera.to_json() == record["estimate"]
        assert frame.sigma_m == record["sigma_m"]


def test_where_it_is_not_set_up_it_says_so_before_anything_is_made(room, tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_VGGT_PYTHON", str(tmp_path / "none"))
    missing = registrar_installation(SETTINGS)
    assert missing.identity is None
    with pytest.raises(MachineError, match="R2SEGO_VGGT_PYTHON"), open_registrar(missing, room.captures, SETTINGS):
        pass


def test_what_it_started_ends_with_it(room, tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_VGGT_PYTHON", sys.executable)
    installed = replace(registrar_installation(SETTINGS), worker=OneAfterTheOther())
    with open_registrar(installed, room.captures, SETTINGS) as registrar:
        assert registrar.name == "VGGT"
    assert installed.worker.closed == 1
    with open_registrar(registrar_installation(Settings()), room.captures, Settings()) as registrar:
        assert isinstance(registrar, PnPRegistrar)
