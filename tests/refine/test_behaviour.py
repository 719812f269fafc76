"""The declared behaviour is placed in its room; what a round selected belongs to its captures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_room import made_up_bundle

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.arrays import save_arrays
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import GenerationError, GeometryError
from r2sego_blender.editing.robot_declaration import declare_robot
from r2sego_blender.geometry.objects.prior_files import PRIORS
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.refine.behaviour import DeclaredBehaviour
from r2sego_blender.views.selection import SELECTION, SelectedViews, select_targets


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


def placed(scene: Scene):
    behaviour = DeclaredBehaviour.of(scene)
    return behaviour.placed(scene.read(CAPTURES), scene.read(PROXY.of_round(0)), scene.read(PRIORS))


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640)])
def test_the_head_camera_lies_whichever_way_the_phone_was_held(scene, width, height):
    held = Camera(width, height, 500.0, 500.0, width / 2, height / 2, np.eye(4))
    seen = DeclaredBehaviour.of(scene).ego_camera([SimpleNamespace(camera=held)])
    assert (seen.width, seen.height) == (640, 480)
    assert np.degrees(2.0 * np.arctan(320.0 / seen.fx)) == pytest.approx(69.0, abs=0.1)


def test_the_free_floor_is_what_captures_vouch_for_and_a_drawn_region_stays(scene):
    outline = np.array(placed(scene).region.within)
    assert outline.shape[0] >= 3 and outline.shape[1] == 2
    surface = scene.read(PROXY.of_round(0)).vertices
    assert (outline.min(axis=0) >= surface.min(axis=0)[:2] - 0.5).all()
    assert (outline.max(axis=0) <= surface.max(axis=0)[:2] + 0.5).all()
    drawn = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    small = declare_robot(scene, changes={"region.within": drawn})
    assert placed(small).region.within == tuple(map(tuple, drawn))


def test_a_named_seat_becomes_its_place_where_the_robot_sits_down(scene):
    sits = declare_robot(scene, scope="sit_down", changes={"behaviours.sit_on": 1.0, "sit_on.target": "chair"})
    assert placed(sits).sit_on.target == pytest.approx((1.0, 2.0))
    (sits.path / "geometry" / "priors" / "chair.npz").rename(sits.path / "chair.npz")
    with pytest.raises(GeometryError, match="no aligned object 'chair'"):
        placed(sits)


def test_a_robot_that_never_sits_needs_no_seat(scene):
    stands = declare_robot(
        scene,
        scope="sit_down",
        changes={"behaviours.sit_on": 0.0, "behaviours.walk_to": 1.0, "sit_on.target": "nothing"},
    )
    assert placed(stands).sit_on.target == "nothing"


def test_a_selection_of_other_candidates_or_captures_is_told(scene):
    captures = scene.read(CAPTURES)

    def saved(candidates: int, seen_by: int) -> None:
        scores = np.linspace(0.9, 0.5, 3)
        selection = select_targets(scores, scores, np.arange(3), np.zeros(3), SelectionSettings())
        overlaps, reference = np.full((3, seen_by), 0.5), np.zeros(3, np.int64)
        selection = replace(selection, overlaps=overlaps, reference=reference)
        SelectedViews(selection, [captures[0].camera] * candidates).save(scene.path / "selection")

    saved(3, len(captures))
    assert len(scene.read(SELECTION).require_captures(len(captures)).candidates) == 3
    for wrong in ((2, len(captures)), (3, len(captures) + 1)):
        saved(*wrong)
        with pytest.raises(GenerationError, match=r"it is of 3 candidates and .* Run"):
            scene.read(SELECTION).require_captures(len(captures))
