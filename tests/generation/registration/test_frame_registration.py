"""Registration of frames: drifted frames are placed, wrong ones are rejected with a reason."""

from dataclasses import replace

import box_room
import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.config.settings import GenerationSettings, RegistrationSettings
from r2sego_blender.core.cameras import look_at, rotation_angle_rad
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.registration.frame_registration import hopeless, register_frame
from r2sego_blender.generation.registration.landmarks import Landmarks

SETTINGS = RegistrationSettings()


@pytest.fixture(scope="module")
def landmarks(room_a):
    return Landmarks.build(room_a.captures, room_a.depths)


@pytest.fixture(scope="module")
def generator(room_a):
    return BlendingGenerator(room_a.captures, room_a.depths, GenerationSettings())


def perturbed(camera, seed, offset_m=0.05, turn_deg=3.0):
    rng = np.random.default_rng(seed)
    axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(np.radians(turn_deg) * axis).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += offset_m * way
    return camera.at(pose)


def registered(room_a, landmarks, image, query, seed=0, **limits):
    reference = room_a.captures[2].camera
    return register_frame(image, query, reference, landmarks, replace(SETTINGS, **limits), seed)


def error_of(estimate, truth):
    """Centimetres and degrees."""
    turn = rotation_angle_rad(estimate.world_from_camera, truth.world_from_camera)
    return 100.0 * np.linalg.norm(estimate.centre - truth.centre), np.degrees(turn)


def test_photographs_off_their_queries_are_placed(room_a, landmarks):
    """A perfect generator that drifts by 5 cm and 3 degrees, at all frozen poses."""
    errors = []
    for index, view in enumerate(room_a.frozen):
        query = perturbed(view.camera, index)
        frame = registered(room_a, landmarks, view.image(), query)
        assert frame.camera is not None, frame.reason
        assert frame.offset_m == pytest.approx(0.05, abs=0.01)
        assert frame.turn_deg == pytest.approx(3.0, abs=0.3)
        assert abs(frame.focal_px / view.camera.fx - 1.0) < 0.01
        errors.append(error_of(frame.camera, view.camera))
    centimetres, degrees = np.quantile(errors, 0.9, axis=0)
    assert centimetres < 0.6
    assert degrees < 0.3


@pytest.mark.parametrize("index", [1, 6, 11])
def test_generated_frames_are_placed_where_they_were_made(room_a, landmarks, generator, index):
    """The embedded generator made to drift: the pose is that of the frame, not of the query."""
    query = room_a.frozen[index].camera
    drifted = perturbed(query, index)
    image = generator.generate(0, [room_a.renderer.condition(drifted)])[-1].image
    frame = registered(room_a, landmarks, image, query)
    assert frame.camera is not None, frame.reason
    centimetres, degrees = error_of(frame.camera, drifted)
    assert centimetres < 0.6
    assert degrees < 0.3


def test_a_drift_beyond_the_gate_is_measured_and_rejected(room_a, landmarks):
    view = room_a.frozen[0]
    image = view.image()
    far = registered(room_a, landmarks, image, perturbed(view.camera, 0, 0.13, 0.5))
    assert far.camera is None
    assert "m from its query, 0.1 m are allowed" in far.reason
    assert error_of(far.estimate, view.camera)[0] < 1.0
    turned = registered(room_a, landmarks, image, perturbed(view.camera, 0, 0.0, 5.0))
    assert turned.camera is None
    assert "it is turned 5.0 deg from its query, 4 are allowed" in turned.reason
    assert error_of(turned.estimate, view.camera)[1] < 0.1


def test_a_frame_of_another_place_is_rejected(room_a, landmarks):
    count = len(room_a.frozen)
    for index, view in enumerate(room_a.frozen):
        other = room_a.frozen[(index + 5) % count]
        frame = registered(room_a, landmarks, other.image(), view.camera)
        assert frame.camera is None
        assert frame.inliers < 0.1 * frame.expected
        assert frame.reason.startswith("rejected: ")


def test_mirrored_shuffled_and_meaningless_frames_are_rejected(room_a, landmarks):
    view = room_a.frozen[3]
    image = view.image()
    blocks = image.reshape(4, 120, 4, 160, 3).transpose(0, 2, 1, 3, 4).reshape(16, 120, 160, 3)
    shuffled = blocks[np.random.default_rng(0).permutation(16)]
    shuffled = shuffled.reshape(4, 4, 120, 160, 3).transpose(0, 2, 1, 3, 4).reshape(image.shape)
    noise = np.random.default_rng(1).random(image.shape, np.float32)
    wrong = {
        "mirrored": image[:, ::-1].copy(),
        "shuffled": shuffled,
        "noise": noise,
        "soft noise": cv2.GaussianBlur(noise, (0, 0), 4.0) * 4.0 - 1.5,
        "one patch everywhere": np.tile(image[200:280, 280:360], (6, 8, 1)),
        "flat": np.full_like(image, 0.5),
        "stripes": np.tile(np.sin(np.arange(640) / 3.0)[None, :, None] * 0.5 + 0.5, (480, 1, 3)),
    }
    for name, frame in wrong.items():
        assert registered(room_a, landmarks, frame.astype(np.float32), view.camera).camera is None, name


def checks(side_m):
    """Squares that repeat for ever, on all surfaces alike."""

    def colour(points):
        odd = np.floor(points / side_m + 1e-3).sum(axis=-1) % 2.0
        return 0.25 + 0.5 * np.repeat(odd[..., None], 3, axis=-1)

    return colour


ALIKE = {
    "checked room": (checks(0.25), [0.0, -1.7, 1.4]),
    "finely checked wall": (checks(0.06), [0.0, 0.9, 1.2]),
    "checked wall": (checks(0.12), [0.0, 0.9, 1.2]),
    "bare wall": (lambda points: np.full(points.shape, 0.6), [0.0, 0.9, 1.2]),
}


@pytest.mark.parametrize("name", ALIKE)
def test_where_all_looks_alike_frames_are_placed_rightly_or_not_at_all(tmp_path, name):
    colour, centre = ALIKE[name]
    lens = box_room.lens(320, 240)
    cameras = [lens.at(look_at(np.add(centre, [aside, 0.0, 0.0]), [0.0, 2.0, 1.2])) for aside in (-0.3, 0.0, 0.3)]
    captures, depths = box_room.write_captures(tmp_path, cameras, boxes=(), colour=colour)
    landmarks = Landmarks.build(captures, depths)
    for seed in range(8):
        query = perturbed(cameras[1], 50 + seed, 0.1, 3.0)
        drifted = perturbed(query, seed, 0.09, 3.5)
        image, _ = box_room.render(drifted, (), colour)
        frame = register_frame(image, query, cameras[1], landmarks, SETTINGS)
        if frame.camera is not None:
            centimetres, degrees = error_of(frame.camera, drifted)
            assert centimetres < 1.5
            assert degrees < 0.5


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"search_radius_px": 8.0}, "no pose fits the"),
        ({"min_correlation": 0.99}, "no pose fits the"),
        ({"match_ratio": 0.1}, "no pose fits the"),
        ({"max_offset_m": 0.02}, "m from its query, 0.02 m are allowed"),
        ({"max_turn_deg": 1.2}, "deg from its query, 1.2 are allowed"),
    ],
)
def test_settings_decide_how_far_off_a_frame_is_found_and_let_through(room_a, landmarks, limits, says):
    """It is 5 cm and 3 degrees off its query, and placed with the defaults."""
    view = room_a.frozen[0]
    query = perturbed(view.camera, 0)
    frame = registered(room_a, landmarks, view.image(), query, **limits)
    assert frame.camera is None and says in frame.reason


def test_each_gate_says_why(room_a, landmarks):
    view = room_a.frozen[0]
    image = view.image()

    def reason(image=image, query=view.camera, **limits):
        frame = registered(room_a, landmarks, image, query, **limits)
        assert frame.camera is None
        assert frame.estimate is not None
        return frame.reason

    assert "9000 are needed" in reason(min_inliers=9000)
    assert "99% are needed" in reason(min_agreement=0.99)
    assert "place is uncertain" in reason(max_sigma_m=0.0002)
    assert "turn is uncertain" in reason(max_sigma_deg=0.001)
    corner = np.full_like(image, 0.5)
    corner[:240, :320] = image[:240, :320]
    assert "of the image, 50% are needed" in reason(corner, min_spread=0.5, min_agreement=0.0)
    long = replace(view.camera, fx=view.camera.fx * 1.05, fy=view.camera.fy * 1.05)
    free = {"focal_sigma": 0.1, "max_focal_error": 0.02, "max_sigma_m": 5.0, "max_sigma_deg": 90.0}
    assert "focal length is" in reason(query=long, **free)


@pytest.mark.parametrize("index", [2, 9])
def test_what_can_be_registered_is_not_hopeless_and_no_frame_is_more_certain(room_a, landmarks, index):
    view, reference = room_a.frozen[index], room_a.captures[2].camera
    assert hopeless(view.camera, reference, landmarks, SETTINGS) == ""
    frame = registered(room_a, landmarks, view.image(), view.camera)
    # A photograph is placed hardly worse than at best, so the limit it half keeps is hopeless there.
    tight = replace(SETTINGS, max_sigma_m=frame.sigma_m / 3.0)
    assert "at best its place would be uncertain" in hopeless(view.camera, reference, landmarks, tight)
    loose = replace(SETTINGS, max_sigma_m=frame.sigma_m / 1.5, max_sigma_deg=frame.sigma_deg / 1.5)
    assert hopeless(view.camera, reference, landmarks, loose) == ""


def test_what_captures_do_not_show_is_hopeless(room_a, landmarks):
    capture = room_a.captures[2].camera
    away = capture.at(capture.world_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0]))  # turned round
    few = replace(landmarks, surfaces=landmarks.surfaces[2:3])
    said = hopeless(away, capture, few, SETTINGS)
    assert said == "only 0 of the captures' patches would be seen, 30 are needed"
    assert "9000 are needed" in hopeless(capture, capture, few, replace(SETTINGS, min_inliers=9000))
    assert "its turn would be" in hopeless(capture, capture, few, replace(SETTINGS, max_sigma_deg=0.001))


def test_a_frame_without_texture_is_rejected(room_a, landmarks):
    camera = room_a.captures[0].camera
    frame = registered(room_a, landmarks, np.full((*camera.shape, 3), 0.5, np.float32), camera)
    assert frame.camera is None
    assert frame.estimate is None
    assert frame.reason.startswith("rejected: no pose fits the 0 of ")


def test_the_same_seed_gives_the_same_bits(room_a, landmarks):
    view = room_a.frozen[7]
    query = perturbed(view.camera, 7)
    first, second = (registered(room_a, landmarks, view.image(), query, seed=4) for _ in range(2))
    assert first.camera.world_from_camera.tobytes() == second.camera.world_from_camera.tobytes()
    assert (first.sigma_m, first.inliers) == (second.sigma_m, second.inliers)


def test_the_pose_does_not_depend_on_which_capture_is_the_reference(room_a, landmarks):
    """The pose is solved relative to the reference and composed with it: the world's stays."""
    view = room_a.frozen[2]
    query = perturbed(view.camera, 2)
    cameras = [
        register_frame(view.image(), query, capture.camera, landmarks, SETTINGS).camera
        for capture in room_a.captures[:3]
    ]
    for camera in cameras:
        assert error_of(camera, cameras[0])[0] < 0.1


def test_wrong_depth_of_one_capture_does_not_carry_the_pose_away(room_a):
    depths = list(room_a.depths)
    depths[2] = depths[2] * np.float32(1.1)
    spoilt = Landmarks.build(room_a.captures, depths)
    view = room_a.frozen[0]
    frame = registered(room_a, spoilt, view.image(), perturbed(view.camera, 0))
    assert frame.camera is not None, frame.reason
    assert error_of(frame.camera, view.camera)[0] < 1.0


def test_completed_depth_leaves_the_pose_less_certain(room_a, landmarks):
    """One capture, whose depths alone tell how far the frame's camera moved."""
    nothing = [np.zeros_like(depth) for depth in room_a.depths]
    completed = Landmarks.build(room_a.captures, nothing, room_a.depths)
    image, query = room_a.frozen[4].image(), room_a.frozen[4].camera
    sure, unsure = (registered(room_a, known, image, query, max_captures=1) for known in (landmarks, completed))
    assert unsure.sigma_m > 1.2 * sure.sigma_m


def test_captures_without_depth_give_no_landmarks(request):
    room = request.getfixturevalue("box_room")  # the module has the fixture's name
    nothing = [np.zeros_like(depth) for depth in room.depths]
    with pytest.raises(GenerationError, match="no capture has any reliable depth"):
        Landmarks.build(room.captures, nothing)
    with pytest.raises(ValueError, match="its camera's size"):
        Landmarks.build(room.captures, room.depths, room.depths[:2])
