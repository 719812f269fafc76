import json

import fake_bundle
import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.core.errors import CaptureError, R2SEgoError, SceneError
from r2sego_blender.results.panels.bundle import Bundle


def test_it_reads_what_the_engine_wrote(bundle):
    assert bundle.name == "room"
    assert [view.name for view in bundle.captures()] == ["capture_0", "capture_1", "capture_2"]
    for view, camera in zip(bundle.captures(), fake_bundle.cameras(), strict=True):
        assert view.image_path.is_file()
        assert view.camera.to_json() == camera.to_json()
    points, colours = bundle.sparse_points()
    assert points.shape == colours.shape == (50, 3)
    assert colours.dtype == np.uint8
    assert bundle.rounds() == 2
    np.testing.assert_array_equal(bundle.proxy(1).vertices, fake_bundle.proxy(1).vertices)


def test_scores_are_those_of_the_selection(bundle):
    views, expected = bundle.candidates(1), fake_bundle.selection()
    np.testing.assert_array_equal(views.poses, fake_bundle.candidate_poses())
    for name in ("rollout", "frame", "deficit", "availability", "score", "survived", "rank", "chosen"):
        np.testing.assert_array_equal(getattr(views.selection, name), getattr(expected, name))
    np.testing.assert_array_equal(views.selection.targets, expected.targets)


def test_targets_come_in_the_order_of_their_rank(bundle):
    assert tuple(bundle.candidates(0).selection.targets) == fake_bundle.TARGETS


def test_a_camera_path_ends_at_its_target(bundle):
    path = bundle.camera_path(0, 0)
    assert len(path) == fake_bundle.PATH_FRAMES
    np.testing.assert_array_equal(path[-1].world_from_camera, bundle.candidates(0).poses[17])
    assert len({(c.width, c.height, c.fx) for c in path}) == 1


@pytest.mark.parametrize(
    "ask",
    [lambda b: b.proxy(7), lambda b: b.candidates(7), lambda b: b.camera_path(0, 9)],
    ids=["proxy", "candidates", "path"],
)
def test_what_is_not_there_is_an_error_with_its_place(bundle, ask):
    with pytest.raises(SceneError, match="rounds"):
        ask(bundle)


def test_a_folder_that_is_no_bundle_is_refused(tmp_path):
    with refused(SceneError, tmp_path / "scene.toml", cure="`r2sego new`"):
        Bundle.open(tmp_path)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"captures": [{}]}', json.dumps({"captures": [1]})])
def test_damaged_cameras_are_an_error_that_names_the_file_and_the_cure(tmp_path, content):
    path = fake_bundle.write_bundle(tmp_path / "damaged.r2s")
    (path / "captures" / "cameras.json").write_text(content)
    with pytest.raises(CaptureError, match=r"cameras\.json.*r2sego new"):
        Bundle.open(path).captures()


@pytest.mark.parametrize("damage", [b"", b"not a zip", None])
@pytest.mark.parametrize(
    "file",
    [
        "captures/sparse.npz",
        "rounds/0/proxy/proxy.npz",
        "rounds/0/selection/candidates.npz",
        "rounds/0/selection/selection.npz",
    ],
)
def test_damaged_arrays_are_an_error_that_names_the_file(tmp_path, file, damage):
    path = fake_bundle.write_bundle(tmp_path / "damaged.r2s")
    whole = (path / file).read_bytes()
    (path / file).write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    bundle = Bundle.open(path)
    with refused(R2SEgoError, path / file):
        bundle.sparse_points() if "sparse" in file else None
        bundle.proxy(0)
        bundle.candidates(0)


@pytest.mark.parametrize(
    ("file", "name", "change"),
    [
        ("captures/sparse.npz", "colours", lambda colours: colours[1:]),
        ("rounds/0/proxy/proxy.npz", "support", lambda support: support[1:]),
        ("rounds/0/selection/candidates.npz", "poses", lambda poses: poses[..., None]),
        ("rounds/0/selection/candidates.npz", "poses", lambda poses: poses * np.nan),
    ],
)
def test_arrays_that_do_not_belong_together_are_an_error_that_names_the_file(tmp_path, file, name, change):
    path = fake_bundle.write_bundle(tmp_path / "damaged.r2s")
    with np.load(path / file) as data:
        arrays = dict(data)
    np.savez(path / file, **arrays | {name: change(arrays[name])})
    bundle = Bundle.open(path)
    with refused(R2SEgoError, path / file):
        bundle.sparse_points() if "sparse" in file else None
        bundle.proxy(0)
        bundle.candidates(0)
