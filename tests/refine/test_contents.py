"""A bundle's contents are read as the steps and the trial need them, and the behaviour is placed once."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_room import made_up_bundle

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.arrays import save_arrays
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import GenerationError, GeometryError
from r2sego_blender.editing.robot_declaration import declare_robot
from r2sego_blender.refine.contents import Contents
from r2sego_blender.views.selection import save_candidates, select_targets

PROXY = "rounds/0/proxy"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A room whose one aligned object is a chair at (1, 2)."""
    made = made_up_bundle(tmp_path_factory.mktemp("contents") / "room.r2s")
    priors = made.path / "geometry" / "priors"
    priors.mkdir(parents=True)
    (made.path / "objects" / "chair").mkdir(parents=True)
    corners = np.array([[0.8, 1.9, 0.0], [1.2, 1.9, 0.4], [1.2, 2.1, 0.4]])
    save_arrays(priors / "chair.npz", vertices=corners, faces=np.array([[0, 1, 2]]))
    return made


def contents_of(scene: Scene) -> Contents:
    return Contents(scene, scene.declaration.settings)


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640)])
def test_the_head_camera_lies_whichever_way_the_phone_was_held(scene, width, height):
    contents = contents_of(scene)
    held = Camera(width, height, 500.0, 500.0, width / 2, height / 2, np.eye(4))
    vars(contents)["captures"] = (SimpleNamespace(camera=held),)
    seen = contents.ego_camera
    assert (seen.width, seen.height) == (640, 480)
    assert np.degrees(2.0 * np.arctan(320.0 / seen.fx)) == pytest.approx(69.0, abs=0.1)


def test_the_free_floor_is_what_captures_vouch_for_and_a_drawn_region_stays(scene):
    contents = contents_of(scene)
    outline = np.array(contents.placed_scope(contents.scope, PROXY).region.within)
    assert outline.shape[0] >= 3 and outline.shape[1] == 2
    surface = contents.proxy(PROXY).vertices
    assert (outline.min(axis=0) >= surface.min(axis=0)[:2] - 0.5).all()
    assert (outline.max(axis=0) <= surface.max(axis=0)[:2] + 0.5).all()
    drawn = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    small = declare_robot(scene, changes={"region.within": drawn})
    contents = contents_of(small)
    assert contents.placed_scope(contents.scope, PROXY).region.within == tuple(map(tuple, drawn))


def test_a_named_seat_becomes_its_place_where_the_robot_sits_down(scene):
    sits = declare_robot(
        scene, scope="sit_down", changes={"behaviours.sit_on": 1.0, "sit_on.target": "chair"}
    )
    contents = contents_of(sits)
    assert contents.placed_scope(contents.scope, PROXY).sit_on.target == pytest.approx((1.0, 2.0))
    (sits.path / "geometry" / "priors" / "chair.npz").rename(sits.path / "chair.npz")
    with pytest.raises(GeometryError, match="no aligned object 'chair'"):
        contents.placed_scope(contents.scope, PROXY)


def test_a_robot_that_never_sits_needs_no_seat(scene):
    stands = declare_robot(
        scene,
        scope="sit_down",
        changes={"behaviours.sit_on": 0.0, "behaviours.walk_to": 1.0, "sit_on.target": "nothing"},
    )
    contents = contents_of(stands)
    assert contents.placed_scope(contents.scope, PROXY).sit_on.target == "nothing"


def test_a_selection_of_other_candidates_or_captures_is_told(scene):
    def saved(candidates: int, captures: int) -> None:
        scores = np.linspace(0.9, 0.5, 3)
        selection = select_targets(scores, scores, np.arange(3), np.zeros(3), SelectionSettings())
        overlaps, reference = np.full((3, captures), 0.5), np.zeros(3, np.int64)
        replace(selection, overlaps=overlaps, reference=reference).save(scene.path / "selection")
        save_candidates(scene.path / "selection", [contents_of(scene).cameras[0]] * candidates)

    known = len(contents_of(scene).captures)
    saved(3, known)
    assert len(contents_of(scene).selection("selection")[1]) == 3
    for wrong in ((2, known), (3, known + 1)):
        saved(*wrong)
        with pytest.raises(GenerationError, match=r"selection\.npz: it is of 3 candidates and .* Run"):
            contents_of(scene).selection("selection")
