"""Eq. 2 against its plain definition, and the references' overlaps against geometry."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.cameras import Camera, look_at
from r2sego_blender.errors import GenerationError
from r2sego_blender.progress import Progress
from r2sego_blender.selection import (
    Selection,
    select_reference,
    select_targets,
    support_scores,
    temporal_nms,
)
from r2sego_blender.settings import SelectionSettings

LENS = Camera(64, 48, 40.0, 40.0, 32.0, 24.0, np.eye(4))
FEW = SelectionSettings(target_views=3, nms_window=5)


class Listening(Progress):
    def __init__(self):
        self.said = []

    def message(self, text, level="info"):
        self.said.append((level, text))


# Scores of a few values only, so that ties are common; frames with gaps.
streams = st.lists(
    st.tuples(
        st.integers(0, 3), st.integers(0, 40), st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]),
        st.sampled_from([0.0, 0.5, 1.0]),
    ),
    max_size=50, unique_by=lambda entry: entry[:2],
)  # fmt: skip


def survives(index, score, rollout, frame, reach):
    """The definition: nothing near scores higher, nothing near and earlier scores the same."""
    for other in range(len(score)):
        if rollout[other] == rollout[index] and 0 < abs(frame[other] - frame[index]) <= reach:
            if score[other] > score[index]:
                return False
            if score[other] == score[index] and frame[other] < frame[index]:
                return False
    return True


@given(streams, st.integers(1, 20), st.integers(1, 8))
def test_nms_and_top_k_are_their_definitions(stream, window, budget):
    rollout, frame, deficit, availability = np.array(stream, np.float64).reshape(-1, 4).T
    settings = SelectionSettings(target_views=budget, nms_window=window)
    selection = select_targets(deficit, availability, rollout, frame, settings)
    score = deficit * availability
    expected = [survives(i, score, rollout, frame, window // 2) for i in range(len(score))]
    assert selection.survived.tolist() == expected
    eligible = sorted(
        (i for i in range(len(score)) if expected[i] and score[i] > 0), key=lambda i: (-score[i], i)
    )
    assert selection.ranked.tolist() == eligible
    assert selection.targets.tolist() == eligible[:budget]
    assert np.flatnonzero(selection.chosen).tolist() == sorted(eligible[:budget])
    assert bool(selection.note) == (len(eligible) < budget)
    assert all(selection.reason)


@given(streams, st.integers(1, 20))
def test_a_suppressor_is_near_and_no_worse(stream, window):
    rollout, frame, score, _ = np.array(stream, np.float64).reshape(-1, 4).T
    suppressor = temporal_nms(score, rollout, frame, window)
    assert (rollout[suppressor] == rollout).all()
    assert (np.abs(frame[suppressor] - frame) <= window // 2).all()
    assert (score[suppressor] >= score).all()


def test_a_run_of_equal_scores_keeps_its_first_frame():
    frames = np.arange(100)
    suppressor = temporal_nms(np.full(100, 0.5), np.zeros(100), frames, 15)
    assert np.flatnonzero(suppressor == frames).tolist() == [0]


def test_reasons_say_what_happened():
    deficit = [0.5, 0.4, 0.0, 0.6, 0.3, 0.2]
    availability = [1.0, 1.0, 1.0, 0.0, 1.0, 1.0]
    settings = SelectionSettings(target_views=1, nms_window=3)
    selection = select_targets(deficit, availability, [0, 0, 1, 2, 3, 4], [7, 8, 0, 0, 0, 0], settings)
    assert selection.reason == (
        "chosen, rank 1 of 1: 50% of the pixels missing, 100% available",
        "suppressed: frame 7 of this rollout scores higher",
        "not eligible: the asset renders every pixel",
        "not eligible: the proxy renders no pixel",
        "not chosen: rank 2 is beyond the budget of 1; 30% of the pixels missing, 100% available",
        "not chosen: rank 3 is beyond the budget of 1; 20% of the pixels missing, 100% available",
    )


def test_too_few_survivors_are_taken_and_told():
    listening = Listening()
    selection = select_targets([0.5, 0.4], [1.0, 1.0], [0, 0], [0, 1], FEW, listening)
    assert selection.targets.tolist() == [0]
    assert listening.said == [("warning", selection.note)]
    assert selection.note.startswith("1 target views instead of 3: of 2 candidates, 1 survive")


def test_no_candidates_give_an_empty_selection():
    selection = select_targets([], [], [], [], FEW)
    assert selection.targets.tolist() == []
    assert selection.note


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_scores_that_are_no_numbers_are_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        select_targets([bad], [1.0], [0], [0], FEW)


def test_a_selection_survives_the_disk(tmp_path):
    rng = np.random.default_rng(0)
    selection = select_targets(
        rng.random(40), rng.random(40), np.repeat([0, 1], 20), np.tile(np.arange(20), 2), FEW
    )
    selection.save(tmp_path)
    loaded = Selection.load(tmp_path)
    for name in vars(selection):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(selection, name))
    words = json.loads((tmp_path / "selection.json").read_text())
    assert [entry["candidate"] for entry in words["targets"]] == selection.targets.tolist()


@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "other"])
def test_a_damaged_selection_is_named(tmp_path, damage):
    select_targets([0.5, 0.1], [1.0, 1.0], [0, 1], [0, 0], FEW).save(tmp_path)
    numbers = tmp_path / "selection.npz"
    if damage == "missing":
        numbers.unlink()
    elif damage == "empty":
        numbers.write_bytes(b"")
    elif damage == "cut":
        numbers.write_bytes(numbers.read_bytes()[:300])
    else:
        words = json.loads((tmp_path / "selection.json").read_text())
        (tmp_path / "selection.json").write_text(json.dumps(words | {"reasons": ["one"]}))
    with pytest.raises(GenerationError, match="again"):
        Selection.load(tmp_path)


def test_scores_count_pixels_at_the_scoring_scale():
    settings = SelectionSettings(scoring_scale=0.5)
    seen = []

    def alpha_of(camera):
        seen.append(camera.shape)
        alpha = np.full(camera.shape, 0.8)
        alpha[:, : camera.width // 4] = 0.79
        return alpha

    def validity_of(camera):
        validity = np.full(camera.shape, 0.79)
        validity[: camera.height // 3] = 0.8
        return validity

    deficit, availability = support_scores([LENS, LENS], alpha_of, validity_of, settings)
    assert seen == [(24, 32)] * 2
    np.testing.assert_array_equal(deficit, 0.25)
    np.testing.assert_allclose(availability, 8 / 24)


def wall_with_screen(camera):
    """Depth of the wall y = 3; from x < 0 a screen at y = 1 hides its half x > 0."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    wall = (3.0 - camera.centre[1]) / rays[..., 1]
    screen = (1.0 - camera.centre[1]) / rays[..., 1]
    hit = camera.centre + rays * screen[..., None]
    hidden = (screen > 0) & (hit[..., 0] > -1.0) & (hit[..., 0] < 0.0)
    return np.where(hidden, screen, wall).astype(np.float32)


def test_the_reference_sees_the_most_and_occlusion_counts():
    settings = SelectionSettings(scoring_scale=0.5)
    target = LENS.at(look_at([1.5, 0.0, 1.0], [1.5, 3.0, 1.0]))
    captures = [
        LENS.at(look_at([-1.5, 0.0, 1.0], [1.5, 3.0, 1.0])),  # looks at the wall, behind the screen
        LENS.at(look_at([1.2, -0.5, 1.0], [1.5, 3.0, 1.0])),  # sees it all
        LENS.at(look_at([1.5, 0.0, 1.0], [1.5, -3.0, 1.0])),  # looks away
    ]
    depths = [wall_with_screen(camera) for camera in captures]
    index, overlaps = select_reference(target, captures, wall_with_screen, depths, settings)
    assert index == 1
    assert overlaps[1] > 0.95
    assert overlaps[2] == 0.0
    free, unhidden = select_reference(
        target, captures[:1], wall_with_screen, [np.full(LENS.shape, 50.0, np.float32)], settings
    )
    assert free == 0
    assert overlaps[0] < unhidden[0] - 0.1


def test_a_target_at_a_capture_overlaps_it_wholly():
    camera = LENS.at(look_at([1.5, 0.0, 1.0], [1.5, 3.0, 1.0]))
    _, overlaps = select_reference(
        camera, [camera], wall_with_screen, [wall_with_screen(camera)], SelectionSettings(scoring_scale=1.0)
    )
    assert overlaps.tolist() == [1.0]


def test_no_captures_are_an_error():
    with pytest.raises(GenerationError, match="no captures"):
        select_reference(LENS, [], wall_with_screen, [], SelectionSettings())
