"""``edit-asset``: what it deletes, and that an edit outlives a refinement."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refined_asset import BACKDROP, CAMERA, ROOM, publish, refined_scene
from refined_asset import r2sego as run

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.asset_edits import ASSET_EDITS, AssetEdit, deleted_by, move_edits, save_edit
from r2sego_blender.splats.formats.ply import load_ply, save_ply
from r2sego_blender.splats.regions import Box, Cells, Lasso

FIELDS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")


@pytest.fixture
def r2sego(monkeypatch):
    return partial(run, monkeypatch)


@pytest.fixture
def scene(tmp_path) -> Scene:
    return refined_scene(tmp_path)


def published(scene: Scene) -> SplatAsset:
    return load_ply(scene.asset_file)


def box_file(folder: Path, half: float = 0.8) -> Path:
    """A box around the point nearest to the middle of the room."""
    pose = np.eye(4)
    pose[:3, 3] = ROOM.asset.means[0]
    file = folder / "box.json"
    box = Box(pose, np.full(3, half)).to_json()
    del box["kind"]  # the option says it
    file.write_text(json.dumps(box))
    return file


def test_a_box_is_deleted_at_once_and_the_rest_kept_to_the_bit(r2sego, scene, tmp_path):
    whole = published(scene)
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path), "--json")
    assert done.exit_code == 0, done.output
    (edit,) = scene.read(ASSET_EDITS)
    gone = edit.deletes(whole.means)
    assert 0 < gone.sum() < len(whole) and edit.name == "edit_001"
    left = published(scene)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(left, name), getattr(whole, name)[~gone])
    told = json.loads(done.stdout)
    assert told["edits"] == [{"name": "edit_001", "regions": ["box"], "deleted": int(gone.sum())}]
    assert (told["gaussians"], told["before"]) == (len(left), len(whole))


def test_an_edit_shows_at_once_where_a_refinement_was_cut_off(r2sego, scene, tmp_path):
    whole = published(scene)
    scene.asset_file.unlink()  # it is published after the last round alone
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path), "--json")
    assert done.exit_code == 0, done.output
    (edit,) = scene.read(ASSET_EDITS)
    left, gone = published(scene), edit.deletes(whole.means)
    assert left.degree == ROOM.asset.degree > 0
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(left, name), getattr(whole, name)[~gone])


def test_an_edit_killed_before_its_asset_is_told_and_made_whole_when_it_is_given_again(
    r2sego, scene, tmp_path, monkeypatch
):
    def killed(*_):
        raise KeyboardInterrupt

    box, whole = box_file(tmp_path), published(scene)
    with monkeypatch.context() as patch:
        patch.setattr("r2sego_blender.editing.asset_edits._publish_again", killed)
        assert r2sego("edit-asset", scene.path, "--box", box).exit_code != 0
    (edit,) = scene.read(ASSET_EDITS)
    listed = r2sego("edit-asset", scene.path, "--list").stdout
    assert f"it still holds {len(whole)}: `r2sego refine`" in listed
    again = r2sego("edit-asset", scene.path, "--box", box)
    assert again.exit_code == 1 and "edit_001: the same regions are deleted already" in again.stderr
    assert "still holds" not in r2sego("edit-asset", scene.path, "--list").stdout
    assert [one.name for one in scene.read(ASSET_EDITS)] == [edit.name]
    assert len(published(scene)) == len(whole) - edit.deletes(whole.means).sum()


def test_a_box_that_can_hold_nothing_is_refused(r2sego, scene, tmp_path):
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path, half=-0.8))
    assert done.exit_code == 1 and "box.json: half_extents are negative. Give half" in done.output
    assert scene.read(ASSET_EDITS) == ()


def test_a_cut_off_edit_is_no_edit(r2sego, scene, tmp_path):
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path), "--json")
    assert done.exit_code == 0
    (scene.path / "asset_edits" / ".unfinished-edit_002.json").write_text("{")
    assert [edit.name for edit in scene.read(ASSET_EDITS)] == ["edit_001"]


def test_an_edit_before_the_first_round_is_kept_for_it(r2sego, scene, tmp_path):
    for file in (scene.asset_file, scene.path / "rounds/0/asset.ply"):
        file.unlink()
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path), "--json")
    assert done.exit_code == 0 and "gaussians" not in json.loads(done.stdout)
    assert len(scene.read(ASSET_EDITS)) == 1 and not scene.asset_file.exists()


def test_an_edit_outlives_a_new_refinement_and_can_be_taken_back(r2sego, scene, tmp_path):
    before = scene.asset_file.read_bytes()
    assert r2sego("edit-asset", scene.path, "--box", box_file(tmp_path), "--name", "floaters").exit_code == 0
    moved = ROOM.asset.subset(np.arange(len(ROOM.asset))[::-1])  # as a refinement leaves others
    save_ply(scene.path / "rounds/0/asset.ply", moved)
    publish(scene)
    assert not deleted_by(scene.read(ASSET_EDITS), published(scene).means).any()
    save_ply(scene.path / "rounds/0/asset.ply", ROOM.asset)
    done = r2sego("edit-asset", scene.path, "--remove", "floaters")
    assert done.exit_code == 0 and scene.read(ASSET_EDITS) == ()
    assert scene.asset_file.read_bytes() == before


def test_several_regions_of_one_call_are_one_edit(r2sego, scene, tmp_path):
    polygon = np.array([[0.0, 0.0], [32.0, 0.0], [32.0, 48.0], [0.0, 48.0]])
    lasso, cells = tmp_path / "lasso.json", tmp_path / "cells.json"
    lasso.write_text(json.dumps(Lasso(CAMERA, polygon, 0.0, 2.5).to_json()))
    cells.write_text(json.dumps(Cells.around(ROOM.asset.means[:5], 0.05).to_json()))
    done = r2sego("edit-asset", scene.path, "--lasso", lasso, "--cells", cells)
    assert done.exit_code == 0 and "lasso, cells" in done.stdout
    (edit,) = scene.read(ASSET_EDITS)
    left = published(scene).means
    assert not edit.deletes(left).any() and len(left) < len(ROOM.asset) + len(BACKDROP)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing is to be edited"),
        (["--remove", "none"], "no edit 'none'"),
        (["--remove", "../scene"], "no edit"),
        (["--box", "BOX", "--remove", "none"], "no edit 'none'"),
        (["--box", "missing.json"], "missing.json"),
        (["--box", "BOX", "--name", "a/b"], "a/b"),
        (["--lasso", "BOX"], "polygon_px"),
    ],
)
def test_a_refused_edit_changes_nothing(r2sego, scene, tmp_path, arguments, words):
    given = [box_file(tmp_path) if a == "BOX" else a for a in arguments]
    before = scene.asset_file.read_bytes()
    done = r2sego("edit-asset", scene.path, *given)
    assert done.exit_code == 1 and words in done.stderr, done.output
    assert scene.asset_file.read_bytes() == before and scene.read(ASSET_EDITS) == ()


@pytest.mark.parametrize("damaged", ["geometry/backdrop.ply", "rounds/0/asset.ply"])
def test_an_edit_of_a_damaged_asset_changes_nothing(r2sego, scene, tmp_path, damaged):
    file, before = scene.path / damaged, scene.asset_file.read_bytes()
    file.write_bytes(file.read_bytes()[:3000])
    done = r2sego("edit-asset", scene.path, "--box", box_file(tmp_path))
    assert done.exit_code == 1 and damaged in done.stderr, done.output
    assert done.stderr.strip().endswith("Run `r2sego refine` again."), done.stderr
    assert scene.asset_file.read_bytes() == before and scene.read(ASSET_EDITS) == ()


def test_an_edit_takes_the_name_of_one_that_goes(r2sego, scene, tmp_path):
    box = box_file(tmp_path)
    assert r2sego("edit-asset", scene.path, "--box", box, "--name", "floaters").exit_code == 0
    wider = box_file(tmp_path, half=1.2)
    done = r2sego("edit-asset", scene.path, "--remove", "floaters", "--box", wider, "--name", "floaters")
    assert done.exit_code == 0, done.output
    (edit,) = scene.read(ASSET_EDITS)
    assert edit.name == "floaters" and edit.regions[0].half_extents.tolist() == [1.2] * 3
    assert not edit.deletes(published(scene).means).any()


def test_a_region_is_not_deleted_twice(r2sego, scene, tmp_path):
    box = box_file(tmp_path)
    assert r2sego("edit-asset", scene.path, "--box", box, "--name", "floaters").exit_code == 0
    done = r2sego("edit-asset", scene.path, "--box", box)
    assert done.exit_code == 1, done.output
    assert "floaters: the same regions are deleted already. Give others" in done.stderr, done.stderr
    assert r2sego("edit-asset", scene.path, "--box", box, "--name", "floaters").exit_code == 0  # the same
    cells = tmp_path / "cells.json"
    cells.write_text(json.dumps(Cells.around(ROOM.asset.means[:5], 0.05).to_json()))
    assert r2sego("edit-asset", scene.path, "--box", box, "--cells", cells).exit_code == 0
    kinds = {edit.name: [one.to_json()["kind"] for one in edit.regions] for edit in scene.read(ASSET_EDITS)}
    assert kinds == {"edit_001": ["cells"], "floaters": ["box"]}


def test_edits_move_with_the_world(scene):
    similarity = np.diag([2.0, 2.0, 2.0, 1.0])
    save_edit(scene, AssetEdit("a", (Box(np.eye(4), np.ones(3)),)))
    move_edits(scene, similarity)
    (edit,) = scene.read(ASSET_EDITS)
    assert edit.deletes(np.array([[1.9, 0.0, 0.0], [2.1, 0.0, 0.0]])).tolist() == [True, False]


def test_a_damaged_edit_is_named(scene):
    (scene.path / "asset_edits").mkdir()
    (scene.path / "asset_edits" / "a.json").write_text('{"regions": 3}')
    with pytest.raises(AssetError, match=r"a\.json"):
        scene.read(ASSET_EDITS)
