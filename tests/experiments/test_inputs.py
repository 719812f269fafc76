"""Captures and frozen views are fixed before anything runs, and told apart."""

from __future__ import annotations

import dataclasses
import json
import shutil

import numpy as np
import pytest
from bundles import new_bundle
from cameras_file import save_cameras_json
from expected_errors import refused
from fake_experiment import PLAN, pictures

from r2sego_blender.bundle.declaration import SOLVED
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.config.fields import fields_of
from r2sego_blender.config.training_settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import ExperimentError, GeometryError
from r2sego_blender.evaluation import arms
from r2sego_blender.evaluation.arms import baseline_settings
from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.inputs import INPUTS, fixed_inputs
from r2sego_blender.experiments.plan import Plan


def posed(tmp_path, captures, frozen):
    """``cameras.json`` of pictures by (name, x)."""
    for file, places in (("captures", captures), ("frozen", frozen)):
        views = [
            Capture(name, tmp_path / folder / name, Camera(8, 6, 6.0, 6.0, 4.0, 3.0, look_at((x, 0, 1), (x, 2, 1))))
            for folder, name, x in places
        ]
        save_cameras_json(tmp_path / f"{file}.json", views)
    listed = {file: json.loads((tmp_path / f"{file}.json").read_text())["captures"] for file in ("captures", "frozen")}
    whole = json.loads((tmp_path / "captures.json").read_text()) | listed
    (tmp_path / "cameras.json").write_text(json.dumps(whole))
    return tmp_path / "cameras.json"


@pytest.fixture
def posed_plan(plan_file, tmp_path):
    order = (4, 0, 2, 1, 3, 5)
    posed(tmp_path, [("room", f"{i:02d}.png", 0.1 * i) for i in order], [("held_out", f"{i}.png", i) for i in (20, 21)])
    paths = 'captures = "room"\nposes = "cameras.json"\nfrozen = "cameras.json"\n'
    plan_file.write_text(f"counts = [3, 5]\n[[scenes]]\n{paths}")
    return Plan.load(plan_file)


def folder_of(tmp_path):
    (tmp_path / "out").mkdir(exist_ok=True)
    return tmp_path / "out"


def test_captures_are_in_the_order_of_their_poses(posed_plan, tmp_path):
    inputs = fixed_inputs(posed_plan, folder_of(tmp_path))["room"]
    assert [name for name, _ in inputs.captures] == [f"{i:02d}.png" for i in (4, 0, 2, 1, 3, 5)]
    assert [name for name, _ in inputs.frozen] == ["20.png", "21.png"]
    assert fixed_inputs(posed_plan, tmp_path / "out")["room"] == inputs


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda folder: pictures(folder / "room", 1, 0) or pictures(folder / "room", 1, 30), "captures"),
        (lambda folder: shutil.copy(folder / "room/00.png", folder / "room/04.png"), "captures of the scene room"),
        (
            lambda folder: shutil.copy(folder / "held_out/20.png", folder / "held_out/21.png"),
            "frozen of the scene room",
        ),
        (lambda folder: (folder / "held_out/20.png").unlink(), "frozen of the scene room"),
    ],
)
def test_what_was_changed_since_is_refused_by_name(plan, tmp_path, change, told):
    fixed_inputs(plan, folder_of(tmp_path))
    change(tmp_path)
    with pytest.raises(ExperimentError, match=told):
        fixed_inputs(plan, tmp_path / "out")


def test_a_frozen_pose_counts_as_much_as_its_picture(posed_plan, tmp_path):
    before = fixed_inputs(posed_plan, folder_of(tmp_path))["room"].frozen_sha256
    cameras = json.loads((tmp_path / "cameras.json").read_text())
    cameras["frozen"][0]["world_from_camera"][0][3] += 1e-3
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    (tmp_path / "another").mkdir()
    assert fixed_inputs(posed_plan, tmp_path / "another")["room"].frozen_sha256 != before
    with pytest.raises(ExperimentError, match="room are not as they were"):
        fixed_inputs(posed_plan, tmp_path / "out")


def test_a_frozen_view_with_a_captures_picture_is_refused_by_name(plan, tmp_path):
    shutil.copy(tmp_path / "room/02.png", tmp_path / "held_out/30.png")
    with pytest.raises(ExperimentError, match=r"30\.png is 02\.png"):
        fixed_inputs(plan, folder_of(tmp_path))


def test_a_frozen_view_with_a_captures_pose_is_refused_by_name(posed_plan, tmp_path):
    folder_of(tmp_path)
    cameras = json.loads((tmp_path / "cameras.json").read_text())
    for index, is_input in ((4, True), (5, False)):  # of six, five are inputs
        cameras["frozen"][1]["world_from_camera"] = cameras["captures"][index]["world_from_camera"]
        (tmp_path / "cameras.json").write_text(json.dumps(cameras))
        if is_input:
            with pytest.raises(ExperimentError, match=r"21\.png is 03\.png"):
                fixed_inputs(posed_plan, tmp_path / "out")
        else:
            fixed_inputs(posed_plan, tmp_path / "out")


def test_counts_beyond_the_captures_are_refused(plan, plan_file, tmp_path):
    plan_file.write_text(PLAN.replace("[3, 5]", "[3, 7]"))
    with pytest.raises(ExperimentError, match="room has 6 captures, and 7 are asked for"):
        fixed_inputs(Plan.load(plan_file), folder_of(tmp_path))


@pytest.mark.parametrize("text", ["", "{}", '{"version": "0", "scenes": {}}', '{"version": "0", "scenes": {"a": 1}}'])
def test_a_file_that_is_damaged_or_of_another_version_is_refused(plan, tmp_path, text):
    (folder_of(tmp_path) / INPUTS).write_text(text)
    with pytest.raises(ExperimentError, match=INPUTS):
        fixed_inputs(plan, tmp_path / "out")


def test_a_scene_that_is_not_there_is_refused_by_name(plan, tmp_path):
    shutil.rmtree(tmp_path / "room")
    with pytest.raises(ExperimentError, match="the scene room is not there"):
        fixed_inputs(plan, folder_of(tmp_path))


def test_what_is_only_looked_at_is_not_fixed(plan, tmp_path):
    fixed_inputs(plan, tmp_path / "out", write=False)
    assert not (tmp_path / "out").exists()


def keys(plan, tmp_path):
    """The cells' keys by seed and count, of what lies there now."""
    found = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    assert len({cell.folder for cell in found}) == len(found)
    return {(cell.seed, cell.captures): cell.key for cell in found}


def test_a_cells_key_changes_with_all_that_it_is_made_of_and_with_nothing_else(plan_file, tmp_path):
    text = PLAN + '[[presets]]\npreset = "preview"\n'

    def keys_of(changed):
        plan_file.write_text(changed)
        return keys(Plan.load(plan_file), tmp_path)

    before = keys_of(text)
    assert len(set(before.values())) == 4
    same = (
        text.replace("[0, 1]", "[0, 1, 5]"),
        text.replace('"vanilla_3dgs", "same_points", "refined"', '"refined", "vanilla_3dgs", "same_points"'),
        text + 'overrides = { rounds = 2 }\nname = "another"\n',  # as preview has them
        text.replace("[0, 1]", "[0, 1]\nthreads = 2\nmemory_mb = 10"),
    )
    for changed in same:
        assert before.items() <= keys_of(changed).items()
    other = (
        text + "overrides = { rounds = 1 }\n",
        text.replace('"same_points", ', ""),
        text.replace('captures = "room"', 'captures = "room"\ncamera_height = "1.2"'),
        text.replace('captures = "room"', 'captures = "room"\noverrides = { captures.max_side_px = 99 }'),
    )
    for changed in other:
        assert not set(before.values()) & set(keys_of(changed).values())
    pictures(tmp_path / "held_out", 1, 30)
    assert not set(before.values()) & set(keys_of(text).values())


OWN_SETTINGS = {"vanilla_3dgs": "VANILLA_3DGS", "gaussgym": "SPARSE_STABLE_SH3", "same_points": "UNBOUNDED"}
"""What each method of others that is trained here has in place of the scene's settings, by its arm."""


@pytest.mark.parametrize("arm", OWN_SETTINGS)
def test_a_cells_key_has_every_setting_that_a_baseline_is_trained_with(plan, tmp_path, monkeypatch, arm):
    """Else a cell whose baseline would be trained otherwise now would keep its record."""
    assert {*baseline_settings(TrainingSettings())} == {*OWN_SETTINGS}
    inputs = fixed_inputs(plan, tmp_path / "out", write=False)

    def key(compared):
        return cells_of(dataclasses.replace(plan, arms=compared), inputs, tmp_path / "out")[0].key

    others = (*(name for name in OWN_SETTINGS if name != arm), "without_generated_views", "refined")
    without, found = key(others), {key((arm, "refined"))}
    fields = [field for field in fields_of(TrainingSettings).values() if field.changes_result]
    for field in fields:
        own = getattr(arms, OWN_SETTINGS[arm])
        with monkeypatch.context() as changed:
            changed.setattr(arms, OWN_SETTINGS[arm], {**own, field.key: f"not {own.get(field.key, field.default)}"})
            found.add(key((arm, "refined")))
            assert key(others) == without, f"{field.key} of {arm} is of no other arm"
    assert len(found) == 1 + len(fields)


FILES = {"robot": "my.xml", "scope": "my.toml", "true_room": "room.npz", "masks": "mask.png", "points": "points.ply"}
"""What decides scores beside photographs and poses."""

PLY = "ply\nformat ascii 1.0\nelement vertex 1\n{}end_header\n{} 0 1 9 9 9\n"
PROPERTIES = "".join(f"property {kind}\n" for kind in ("float x", "float y", "float z"))
PROPERTIES += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))


@pytest.fixture
def sensed_plan(plan_file, tmp_path):
    """Photographs with a sensor's depth, a mask and points, a robot and a scope of one's own, in a known room."""
    frames = []
    for index in range(4):
        pose = look_at((0.1 * index, 0, 1), (0.1 * index, 2, 1)).tolist()
        named = {"file_path": f"room/{index:02d}.png", "depth_file_path": f"{index}.npy", "transform_matrix": pose}
        frames.append({**named, "w": 8, "h": 6, "fl_x": 6.0, "fl_y": 6.0, "cx": 4.0, "cy": 3.0})
        np.save(tmp_path / f"{index}.npy", np.ones((6, 8), np.float32))
    frames[0]["mask_path"] = "mask.png"
    told = {"metric": True, "frames": frames, "ply_file_path": "points.ply"}
    (tmp_path / "transforms.json").write_text(json.dumps(told))
    for number, name in enumerate(FILES.values()):
        (tmp_path / name).write_text(f"<mujoco model='{number}'/>")
    (tmp_path / "points.ply").write_text(PLY.format(PROPERTIES, 0))
    paths = 'captures = "room"\nposes = "transforms.json"\nfrozen = "held_out"\nrobot = "my.xml"\nscope = "my.toml"\n'
    plan_file.write_text(f"counts = [3]\n[[scenes]]\n{paths}")
    return Plan.load(plan_file)


@pytest.mark.parametrize("what", [*FILES, "sensor_depth"])
def test_all_files_that_decide_scores_are_fixed_and_in_the_keys(sensed_plan, tmp_path, what):
    before = keys(sensed_plan, tmp_path)
    fixed_inputs(sensed_plan, folder_of(tmp_path))
    if what == "sensor_depth":
        np.save(tmp_path / "1.npy", np.full((6, 8), 2.0, np.float32))
    else:
        text = PLY.format(PROPERTIES, 7) if what == "points" else "<mujoco model='another'/>"
        (tmp_path / FILES[what]).write_text(text)
    with pytest.raises(ExperimentError, match=f"{what} of the scene room "):
        fixed_inputs(sensed_plan, tmp_path / "out")
    shutil.rmtree(tmp_path / "out")
    assert not set(before.values()) & set(keys(sensed_plan, tmp_path).values())


def test_a_meshs_content_and_a_policys_are_those_of_their_robot_and_scope(sensed_plan, tmp_path):
    mesh = (
        "<asset><mesh name='a' file='a.obj'/></asset><worldbody><body><geom type='mesh' mesh='a'/></body></worldbody>"
    )
    (tmp_path / "my.xml").write_text(f"<mujoco>{mesh}</mujoco>")
    (tmp_path / "my.toml").write_text('[controller]\nkind = "policy"\nfile = "walk.onnx"\n')
    for name in ("a.obj", "walk.onnx"):
        (tmp_path / name).write_text("one")
    before = keys(sensed_plan, tmp_path)
    for name in ("a.obj", "walk.onnx"):
        (tmp_path / name).write_text("another")
        now = keys(sensed_plan, tmp_path)
        assert not set(before.values()) & set(now.values())
        before = now


def test_a_file_with_more_than_is_known_is_refused_by_it(plan, tmp_path):
    fixed_inputs(plan, folder_of(tmp_path))
    told = json.loads((tmp_path / "out" / INPUTS).read_text())
    told["scenes"]["room"]["weather"] = "fine"
    (tmp_path / "out" / INPUTS).write_text(json.dumps(told))
    with pytest.raises(ExperimentError, match="weather of the scene room"):
        fixed_inputs(plan, tmp_path / "out")


def of_bundle(plan_file, tmp_path):
    """A bundle of three captures, and its plan."""
    camera = Camera(8, 6, 6.0, 6.0, 4.0, 3.0, np.eye(4))

    def fill(place):
        (place / "captures").mkdir()
        save_captures(place / "captures", [Capture(f"{i}", tmp_path / f"room/0{i}.png", camera) for i in range(3)])

    scene = new_bundle(tmp_path / "made.r2s", fill)
    plan_file.write_text('[[scenes]]\ncaptures = "made.r2s"\nfrozen = "held_out"\n')
    return scene, Plan.load(plan_file)


def test_a_bundles_own_captures_and_edits_are_fixed(plan_file, tmp_path):
    scene, plan = of_bundle(plan_file, tmp_path)
    (cell,) = cells_of(plan, fixed_inputs(plan, folder_of(tmp_path)), tmp_path / "out")
    assert cell.captures == 3 and cell.imported == scene.path and cell.shared is None
    scene.declare(overrides={"rounds": 1})  # which the plan's presets decide
    fixed_inputs(plan, tmp_path / "out")
    (scene.path / "objects").mkdir()
    (scene.path / "objects/chair.json").write_text("{}")
    with pytest.raises(ExperimentError, match="poses of the scene made "):
        fixed_inputs(plan, tmp_path / "out")


@pytest.mark.parametrize("is_bundle", [True, False])
def test_poses_of_frozen_views_are_refused_where_those_of_captures_are_solved(plan_file, tmp_path, is_bundle):
    """Before hours of refining: no frame has both."""
    posed(tmp_path, [], [("held_out", "20.png", 1.0)])
    captures = "room"
    if is_bundle:
        scene, _ = of_bundle(plan_file, tmp_path)
        scene.declare(captures_source=f"{SOLVED}, 3 of 3 photographs")
        captures = "made.r2s"
    plan_file.write_text(f'[[scenes]]\ncaptures = "{captures}"\nfrozen = "cameras.json"\n')
    with refused(ExperimentError, "cameras.json", "solved", cure="folder"):
        fixed_inputs(Plan.load(plan_file), tmp_path / "out", write=False)


@pytest.mark.parametrize("what", ["import_settings", "mesh_library", "robot"])
def test_what_a_bundle_was_made_with_is_fixed_and_in_the_keys(plan_file, tmp_path, what):
    scene, plan = of_bundle(plan_file, tmp_path)
    (tmp_path / "library").mkdir()
    for name in ("library/chair.obj", "my.xml"):
        (tmp_path / name).write_text("<mujoco/>")
    scene.declare(mesh_library=str(tmp_path / "library"), robot=str(tmp_path / "my.xml"))
    before = keys(plan, tmp_path)
    fixed_inputs(plan, folder_of(tmp_path))
    if what == "import_settings":
        scene.declare(overrides={"captures.max_side_px": 99})
    else:
        file = {"mesh_library": "library/chair.obj", "robot": "my.xml"}[what]
        (tmp_path / file).write_text("<mujoco model='another'/>")
    with pytest.raises(ExperimentError, match=f"{what} of the scene made "):
        fixed_inputs(plan, tmp_path / "out")
    shutil.rmtree(tmp_path / "out")
    assert not set(before.values()) & set(keys(plan, tmp_path).values())


def test_a_bundles_library_that_is_a_whole_disk_is_not_read(plan_file, tmp_path, monkeypatch):
    monkeypatch.setattr("r2sego_blender.geometry.objects.shapes._MOST_LIBRARY_FILES", 2)
    scene, plan = of_bundle(plan_file, tmp_path)
    (tmp_path / "disk/folder").mkdir(parents=True)
    for index in range(3):
        (tmp_path / f"disk/folder/{index}.obj").touch()
    scene.declare(mesh_library=str(tmp_path / "disk"))
    with pytest.raises(GeometryError, match="disk"):
        fixed_inputs(plan, folder_of(tmp_path))
