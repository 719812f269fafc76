"""What a bundle says its steps published is looked over once, where it is read.

Sound results are read to the bit; one number beyond its range, or of another kind, is damage.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_bundle import cameras, candidate_poses, ego_camera, selection, write_bundle

from r2sego_blender.bundle.backends import controller_backend
from r2sego_blender.bundle.figures import COUNTS, read_table
from r2sego_blender.bundle.journal import Journal
from r2sego_blender.captures.frame.correction_history import corrections_of
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import load_captures
from r2sego_blender.core.errors import CaptureError, GenerationError, GeometryError, SceneError
from r2sego_blender.generation.conditions.condition_files import load_conditions, save_conditions
from r2sego_blender.generation.conditions.conditions import Condition
from r2sego_blender.generation.decisions import decision_of
from r2sego_blender.generation.ego_views import check_views, load_pseudo_observations
from r2sego_blender.generation.view_records import read_camera_path, read_views
from r2sego_blender.geometry.room.completed_depth import CompletedDepth
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.geometry.stereo.stereo import DepthMap
from r2sego_blender.views.selection import Selection, load_candidate_poses, load_candidates, save_candidates

CAMERA = ego_camera()
SIZE = CAMERA.shape
UP = np.array([0.0, 0.0, 1.0])
NAN, INFINITE = np.nan, np.inf


def depth_map() -> DepthMap:
    normals = np.tile(UP, (*SIZE, 1)).astype(np.float32)
    ones = np.ones(SIZE, np.float32)
    return DepthMap(2.0 * ones, normals, 0.1 * ones, np.ones(SIZE, np.uint8), CAMERA)


def completed() -> CompletedDepth:
    return CompletedDepth(np.full(SIZE, 2.0, np.float32), np.ones(SIZE, np.uint8), CAMERA)


def planes() -> RoomPlanes:
    return RoomPlanes(np.stack([UP, -UP]), np.array([0.0, -2.5]), np.array([7, 9]), np.array([True, False]))


def observed() -> ObservedGeometry:
    points = np.ones((5, 3), np.float32)
    normals = np.tile(UP, (5, 1)).astype(np.float32)
    return ObservedGeometry(points, normals, 0.5 * points, np.ones((5, 3), bool), np.ones(5, np.float32))


def sparse() -> SparsePoints:
    seen = np.array([[True, False], [True, True]])
    pixels = np.where(seen[..., None], 3.0, NAN).astype(np.float32).repeat(2, axis=2)
    return SparsePoints(np.ones((2, 3)), np.ones((2, 3), np.uint8), seen, np.ones(2), pixels)


_RESULTS = {
    "depth": (depth_map(), GeometryError),
    "completed": (completed(), GeometryError),
    "planes": (planes(), GeometryError),
    "observed": (observed(), GeometryError),
    "sparse": (sparse(), CaptureError),
}


@pytest.mark.parametrize(
    ("result", "name", "value"),
    [
        *[("depth", "depth", value) for value in (NAN, INFINITE, -0.5, 1e30)],
        *[("depth", "normal", value) for value in (NAN, -INFINITE, 2.0)],
        *[("depth", "cost", value) for value in (NAN, 1e9)],
        *[("depth", "lens", value) for value in (NAN, -1.0, 0.0, 1e300)],
        *[("depth", "world_from_camera", value) for value in (NAN, 1e308, 0.5)],
        *[("completed", "depth", value) for value in (NAN, INFINITE, -0.5, 1e30)],
        ("completed", "source", 9),
        *[("planes", "normals", value) for value in (NAN, INFINITE, 1e300, 0.3)],
        *[("planes", "offsets", value) for value in (NAN, -INFINITE, 1e300)],
        ("planes", "inliers", -3),
        *[("observed", "points", value) for value in (NAN, INFINITE, 1e30)],
        *[("observed", "normals", value) for value in (NAN, 3.0)],
        *[("observed", "colours", value) for value in (NAN, -0.1, 1.5)],
        *[("observed", "confidence", value) for value in (NAN, -0.1, 1.5)],
        *[("sparse", "points", value) for value in (NAN, INFINITE, 1e300)],
        *[("sparse", "error_px", value) for value in (NAN, INFINITE, -1.0)],
        ("sparse", "pixels", NAN),
    ],
)
def test_a_number_out_of_its_range_is_damage(tmp_path, result, name, value):
    sound, error = _RESULTS[result]
    file = tmp_path / "result.npz"
    sound.save(file)
    type(sound).load(file)
    arrays = _arrays(file)
    spoiled = arrays[name].copy()
    spoiled.reshape(-1)[0] = value
    _refused(sound, error, file, arrays | {name: spoiled})


@pytest.mark.parametrize(
    ("result", "name"),
    [("planes", "bounding"), ("observed", "visibility"), ("sparse", "visibility"), ("completed", "source")],
)
def test_yes_and_no_and_indices_are_no_other_numbers(tmp_path, result, name):
    sound, error = _RESULTS[result]
    file = tmp_path / "result.npz"
    sound.save(file)
    arrays = _arrays(file)
    _refused(sound, error, file, arrays | {name: arrays[name].astype(np.float64)})


def _arrays(file: Path) -> dict[str, np.ndarray]:
    with np.load(file) as data:
        return {name: data[name] for name in data.files}


def _refused(sound: Any, error: type[Exception], file: Path, arrays: dict[str, np.ndarray]) -> None:
    np.savez(file, **arrays)
    with pytest.raises(error, match=r"result\.npz"):
        type(sound).load(file)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[(name, value) for name in ("deficit", "availability", "score", "overlaps") for value in (NAN, -0.1, 1.2)],
        ("rollout", -1),
        ("frame", -1),
    ],
)
def test_scores_are_shares(tmp_path, name, value):
    selection().save(tmp_path)
    arrays = _arrays(tmp_path / "selection.npz")
    arrays[name].reshape(-1)[0] = value
    np.savez(tmp_path / "selection.npz", **arrays)
    with pytest.raises(GenerationError, match=r"selection\.npz"):
        Selection.load(tmp_path)


@pytest.mark.parametrize("name", ["rank", "reference", "rollout", "chosen", "survived"])
def test_a_selections_whole_numbers_are_no_floats(tmp_path, name):
    selection().save(tmp_path)
    arrays = _arrays(tmp_path / "selection.npz")
    np.savez(tmp_path / "selection.npz", **arrays | {name: arrays[name].astype(np.float64)})
    with pytest.raises(GenerationError, match=r"selection\.npz"):
        Selection.load(tmp_path)


def test_words_of_a_selection_control_no_terminal(tmp_path):
    selection().save(tmp_path)
    file = tmp_path / "selection.json"
    words = json.loads(file.read_text())
    words["reasons"][0] = words["note"] = "\x1b[2Jgone"
    file.write_text(json.dumps(words))
    found = Selection.load(tmp_path)
    assert found.reason[0] == found.note == "\\x1b[2Jgone"
    assert found.reason[1:] == selection().reason[1:]


@pytest.mark.parametrize("value", [NAN, 1e308, 0.5])
def test_candidates_stand_at_rigid_poses(tmp_path, value):
    save_candidates(tmp_path, [CAMERA.at(pose) for pose in candidate_poses()])
    np.testing.assert_array_equal([camera.world_from_camera for camera in load_candidates(tmp_path)], candidate_poses())
    poses = candidate_poses()
    poses[-1, 0, 0] = value
    np.savez(tmp_path / "candidates.npz", poses=poses)
    for read in (load_candidates, load_candidate_poses):
        with pytest.raises(GenerationError, match=r"candidates\.npz"):
            read(tmp_path)


@pytest.fixture
def bundle(tmp_path):
    return write_bundle(tmp_path / "b.r2s")


def _change(file: Path, **changes: Any) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


_STRETCHED = cameras()[1].to_json() | {"world_from_camera": np.diag([2.0, 2.0, 2.0, 1.0]).tolist()}


@pytest.mark.parametrize(
    "changes",
    [
        {"estimate": _STRETCHED},
        {"estimate": cameras()[1].to_json() | {"fx": -50.0}},
        {"rank": -1},
        {"reference": -1},
        {"reference": [0]},
    ],
)
def test_an_estimated_view_is_a_camera(bundle, changes):
    views = bundle / "rounds" / "0" / "views"
    check_views_of(views)
    _change(views / "000" / "pose.json", **changes)
    with pytest.raises(GenerationError, match="000"):
        load_pseudo_observations(views)


def check_views_of(views: Path) -> None:
    check_views(views)
    assert len(load_pseudo_observations(views)) == 3


@pytest.mark.parametrize(
    "changes",
    [{"focal_px": "inf"}, {"overlap": "nan"}, {"sigma_m": None}, {"candidate": 1e300}, {"frame": -1}, {"rank": 2**40}],
)
def test_a_view_is_told_in_numbers(bundle, changes):
    views = bundle / "rounds" / "0" / "views"
    assert len(read_views(views, 3)) == 4
    _change(views / "000" / "pose.json", **changes)
    with pytest.raises(GenerationError, match=r"pose\.json"):
        read_views(views, 3)


@pytest.mark.parametrize("budget", [-1, 1e300, "x", None])
def test_a_budget_is_a_number_of_views(tmp_path, budget):
    selection().save(tmp_path)
    _change(tmp_path / "selection.json", budget=budget)
    with pytest.raises(GenerationError, match=r"selection\.json"):
        Selection.load(tmp_path)


def test_what_a_view_says_controls_no_terminal(bundle):
    views = bundle / "rounds" / "0" / "views"
    _change(views / "000" / "pose.json", reason="\x1b]0;title\x07", reference_name="\u202egnp.a")
    _change(views / "000" / "path.json", note="a\nb")
    record = read_views(views, 3)[0]
    assert all(text.isprintable() for text in (record.reason, record.reference, record.note))


def test_a_path_goes_from_camera_to_camera(bundle):
    file = bundle / "rounds" / "0" / "views" / "000" / "path.json"
    assert read_camera_path(file)
    _change(file, cameras=[_STRETCHED])
    with pytest.raises(GenerationError, match=r"path\.json"):
        read_camera_path(file)


@pytest.mark.parametrize("content", ["[]", "{", '{"accepted": 1}', "[" * 100_000, '{"accepted": NaN}', '"\\ud800"'])
def test_a_decision_is_yes_or_no(tmp_path, content):
    (tmp_path / "decision.json").write_text(content)
    with pytest.raises(GenerationError, match=r"decision\.json"):
        decision_of(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"name": "\x1b[31mred"},
        {"name": ""},
        {"width": 1e300},
        {"height": 65_536},
        {"fy": 0},
        {"cx": 1e300},
        {"world_from_camera": np.full((4, 4), 1e308).tolist()},
        {"world_from_camera": {}},
        {"file": 7},
        {"file": "a\0b"},
        {"photograph_lens": []},
        {"photograph_lens": {"width": 64, "height": 48, "fx": 50, "fy": 50, "cx": 32, "cy": 24, "distortion": [1e300]}},
        {"photograph_lens": {"width": 64, "height": 48, "fx": -50, "fy": 50, "cx": 32, "cy": 24}},
        {"photograph_turns": 9},
    ],
)
def test_a_registered_capture_is_a_photograph_and_a_camera(bundle, changes):
    folder = bundle / "captures"
    load_captures(folder)
    listed = json.loads((folder / "cameras.json").read_text())["captures"]
    _change(folder / "cameras.json", captures=[*listed[:-1], listed[-1] | changes])
    with pytest.raises(CaptureError) as refused:
        load_captures(folder)
    assert str(refused.value).isprintable()


CORRECTION = {
    "new_from_old": np.diag([2.0, 2.0, 2.0, 1.0]).tolist(),
    "world_from_capture": np.eye(4).tolist(),
    "ground": "floor plane",
    "scale_source": "metric poses",
}


@pytest.mark.parametrize(
    "changes",
    [
        {"new_from_old": np.diag([2.0, 1.0, 2.0, 1.0]).tolist()},
        {"new_from_old": np.diag([-1.0, 1.0, 1.0, 1.0]).tolist()},
        {"new_from_old": np.zeros((4, 4)).tolist()},
        {"world_from_capture": np.full((4, 4), 1e308).tolist()},
        {"world_from_capture": [[1, 2], [3]]},
        {"ground": 7},
        {"made": []},
    ],
)
def test_a_correction_is_a_similarity(tmp_path, changes):
    file = tmp_path / "corrections.json"
    file.write_text(json.dumps([CORRECTION]))
    assert len(corrections_of(tmp_path)) == 1
    file.write_text(json.dumps([CORRECTION, CORRECTION | changes]))
    with pytest.raises(CaptureError, match=r"corrections\.json"):
        corrections_of(tmp_path)


@pytest.mark.parametrize("content", ["[]", "{", '{"a": 1e999}', f'{{"a": {10**300}}}', '{"a":' * 2000])
def test_a_table_is_an_object_of_finite_numbers(tmp_path, content):
    (tmp_path / "metrics.json").write_text(content)
    for read in (read_table, COUNTS.load):
        with pytest.raises(SceneError, match=r"metrics\.json"):
            read(tmp_path / "metrics.json")


@pytest.mark.parametrize(
    "line",
    [
        '{"step": "../../victim", "output": "a"}',
        '{"step": "/etc/passwd", "output": "a"}',
        '{"step": "C:\\\\victim", "output": "a"}',
        '{"step": "rounds/x/proxy", "output": "a"}',
        '{"step": "rounds", "output": "a"}',
        '{"step": "a\\u001b[2J", "output": "a"}',
        f'{{"step": "asset.ply", "seconds": {10**300}}}',
        '{"step": "asset.ply", "seconds": NaN}',
        "[" * 100_000,
        "9" * 5000,
    ],
)
def test_a_line_that_no_step_wrote_is_passed_over(tmp_path, line):
    sound = '{"step": "rounds/0/proxy", "inputs": "a", "output": "b"}\n'
    (tmp_path / "journal.jsonl").write_text(sound + line + "\n" + sound.replace("proxy", "views"))
    assert [record["step"] for record in Journal(tmp_path).steps()] == ["rounds/0/proxy", "rounds/0/views"]


def test_the_controllers_name_controls_no_terminal_and_rounds_have_numbers(tmp_path):
    told = tmp_path / "rounds" / "0" / "rollouts" / "rollouts.json"
    told.parent.mkdir(parents=True)
    told.write_text(json.dumps({"rollouts": [{"controller": "policy \x1b[2J.pt"}]}))
    assert controller_backend(tmp_path) == {"controller": "policy \\x1b[2J.pt"}
    (tmp_path / "rounds" / "x" / "rollouts").mkdir(parents=True)
    (tmp_path / "rounds" / "x" / "rollouts" / "rollouts.json").write_text("{}")
    assert controller_backend(tmp_path) == {}


@pytest.mark.parametrize(("name", "value"), [("depth", NAN), ("depth", -1.0), ("validity", 7.0)])
def test_conditions_are_numbers_in_their_range(tmp_path, name, value):
    parts = {
        "depth": np.full(SIZE, 2.0, np.float32),
        "normal": np.tile(UP, (*SIZE, 1)).astype(np.float32),
        "provenance": np.ones(SIZE, np.uint8),
        "validity": np.ones(SIZE, np.float32),
        "instance": np.zeros(SIZE, np.int32),
    }
    save_conditions(tmp_path, [Condition(CAMERA, **parts)])
    load_conditions(tmp_path)
    parts[name][0, 0] = value
    with np.errstate(invalid="ignore"):
        save_conditions(tmp_path, [Condition(CAMERA, **parts)])
    with pytest.raises(GenerationError, match=r"000\.exr"):
        load_conditions(tmp_path)
