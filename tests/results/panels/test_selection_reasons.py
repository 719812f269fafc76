"""Why a candidate is a target or not, in words from the files."""

import json
import shutil
from dataclasses import replace

import fake_bundle
import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.errors import GenerationError, RobotError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.selection_reasons import suppressor_of
from r2sego_blender.results.panels.view_scores import RoundScores
from r2sego_blender.views.selection import save_candidates, select_targets

SCORES = [0.1, 0.9, 0.3, 0.0, 0.6, 0.5]  # rollout 0 twice within 15 frames, rollout 1, 2, 3, 4
ROLLOUT, FRAME = [0, 0, 1, 2, 3, 4], [4, 5, 0, 0, 0, 0]


@pytest.fixture
def told(bundle_path, tmp_path):
    """A round of six candidates, of which two become targets."""
    path = shutil.copytree(bundle_path, tmp_path / "room.r2s")
    made = select_targets(
        np.array(SCORES), np.ones(6), np.array(ROLLOUT), np.array(FRAME), SelectionSettings(target_views=2)
    )
    overlaps = np.zeros((6, 3))
    overlaps[1] = 0.2, 0.75, 0.0
    reference = np.array([-1, 1, -1, -1, 0, -1])
    overlaps[4, 0] = 0.5
    folder = path / "rounds" / "0" / "selection"
    replace(made, reference=reference, overlaps=overlaps).save(folder)
    save_candidates(folder, [fake_bundle.ego_camera().at(pose) for pose in fake_bundle.candidate_poses()[:6]])
    return path


WORDS = {
    0: "Suppressed: frame 5 of this rollout scores higher (0.900 against 0.100), 1 frame away, "
    "within the window of 15; that is target 1.",
    1: "Chosen, rank 1 of 2: 90% of the pixels missing, 100% available. "
    "Its reference capture_1 sees 75% of it, then capture_0 20%.",
    2: "Not chosen: rank 4 is beyond the budget of 2; 30% of the pixels missing, 100% available; "
    "it scores 0.300, the last target 0.600.",
    3: "Not eligible: the asset renders every pixel.",
    4: "Chosen, rank 2 of 2: 60% of the pixels missing, 100% available. Its reference capture_0 sees 50% of it.",
}


@pytest.mark.parametrize("index", WORDS)
def test_reasons_are_told_with_the_numbers_they_compare(told, index):
    assert RoundScores.read(Bundle.open(told), 0).why(index) == WORDS[index]


def test_a_suppressor_is_found_in_its_own_rollout(told):
    scores = RoundScores.read(Bundle.open(told), 0)
    assert [suppressor_of(scores.selection, index) for index in range(6)] == [1, -1, -1, -1, -1, -1]


def test_candidates_are_found_by_rollout_and_frame(bundle):
    scores = RoundScores.read(bundle, 0)
    assert (len(scores), scores.rollouts) == (fake_bundle.CANDIDATES, 4)
    np.testing.assert_array_equal(scores.of_rollout(2), np.arange(20, 30))
    assert scores.nearest(2, 3.4) == 23
    assert scores.nearest(2, 99.0) == 29
    assert scores.nearest(7, 0.0) == -1
    assert tuple(one.candidate for one in scores.ranked) == fake_bundle.TARGETS
    assert scores.best_score == fake_bundle.selection().score.max()


def test_a_rollout_says_which_attempt_it_is(bundle):
    scores = RoundScores.read(bundle, 0)
    assert [scores.origin(rollout) for rollout in range(3)] == ["Attempt 0, walk_to", "Attempt 3, walk_to", ""]


def test_damaged_attempts_are_an_error_and_missing_ones_are_not(told):
    file = told / "rounds" / "0" / "rollouts" / "rollouts.json"
    file.write_text('{"rollouts": [1]}')
    with refused(RobotError, "rollouts/rollouts.json"):
        RoundScores.read(Bundle.open(told), 0)
    file.unlink()
    assert RoundScores.read(Bundle.open(told), 0).origin(0) == ""


def test_a_round_without_a_selection_has_none(bundle):
    assert RoundScores.read(bundle, 9) is None


@pytest.mark.parametrize("damage", ["", "[]", "{}", '{"reasons": []}', "lost"])
def test_damaged_words_are_an_error_that_names_the_file(told, damage):
    file = told / "rounds" / "0" / "selection" / "selection.json"
    words = json.loads(file.read_text())
    words["reasons"].pop()
    file.write_text(json.dumps(words) if damage == "lost" else damage)
    with pytest.raises(GenerationError, match="selection"):
        RoundScores.read(Bundle.open(told), 0)
