"""Eq. 2 against its plain definition."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from progress_recorder import ProgressRecorder

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.views.selection import Selection, load_candidates, save_candidates, select_targets, temporal_nms

FEW = SelectionSettings(target_views=3, nms_window=5)

# Scores of a few values only, so that ties are common; frames with gaps.
streams = st.lists(
    st.tuples(
        st.integers(0, 3),
        st.integers(0, 40),
        st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]),
        st.sampled_from([0.0, 0.5, 1.0]),
    ),
    max_size=50,
    unique_by=lambda entry: entry[:2],
)


def survivors(score, rollout, frame, window):
    """The definition, by looking at all pairs: local maxima of the window, then the best of near ones."""

    def better(a, b):
        return (-score[a], frame[a]) < (-score[b], frame[b])

    def apart(a, b):
        return abs(frame[a] - frame[b]) if rollout[a] == rollout[b] else np.inf

    every = range(len(score))
    maxima = [i for i in every if not any(apart(i, k) <= window // 2 and better(k, i) for k in every)]
    kept = []
    for i in sorted(maxima, key=lambda i: (-score[i], frame[i])):
        if all(apart(i, k) > window for k in kept):
            kept.append(i)
    return [i in kept for i in every]


@given(streams, st.integers(1, 20), st.integers(1, 8))
def test_nms_and_top_k_are_their_definitions(stream, window, budget):
    rollout, frame, deficit, availability = np.array(stream, np.float64).reshape(-1, 4).T
    settings = SelectionSettings(target_views=budget, nms_window=window)
    selection = select_targets(deficit, availability, rollout, frame, settings)
    score = deficit * availability
    expected = survivors(score, rollout, frame, window)
    assert selection.survived.tolist() == expected
    eligible = sorted(
        (i for i in range(len(score)) if expected[i] and score[i] > 0), key=lambda i: (-score[i], rollout[i], frame[i])
    )
    assert selection.ranked.tolist() == eligible
    assert selection.targets.tolist() == eligible[:budget]
    assert np.flatnonzero(selection.chosen).tolist() == sorted(eligible[:budget])
    assert bool(selection.note) == (len(eligible) < budget)
    assert all(selection.reason)


@given(streams, st.integers(1, 20), st.integers(1, 8), st.sampled_from(["score", "random"]))
def test_what_every_selection_holds(stream, window, budget, ranking):
    rollout, frame, deficit, availability = np.array(stream, np.float64).reshape(-1, 4).T
    settings = SelectionSettings(target_views=budget, nms_window=window, ranking=ranking)
    selection = select_targets(deficit, availability, rollout, frame, settings, rng=np.random.default_rng(7))
    targets = selection.targets
    for a in targets:
        for b in targets:
            assert a == b or rollout[a] != rollout[b] or abs(frame[a] - frame[b]) > window
    eligible = selection.survived & ((ranking == "random") | (selection.score > 0.0))
    assert len(targets) == min(budget, eligible.sum())
    if ranking == "score" and len(targets):
        unselected = eligible & ~selection.chosen
        assert selection.score[targets].min() >= selection.score[unselected].max(initial=0.0)


@given(streams, st.integers(1, 20), st.sampled_from(["score", "random"]), st.randoms())
def test_the_order_of_the_candidates_does_not_matter(stream, window, ranking, random):
    settings = SelectionSettings(target_views=4, nms_window=window, ranking=ranking)

    def chosen(stream):
        rollout, frame, deficit, availability = np.array(stream, np.float64).reshape(-1, 4).T
        rng = np.random.default_rng(3)
        selection = select_targets(deficit, availability, rollout, frame, settings, rng=rng)
        said = dict(zip(zip(rollout, frame, strict=True), selection.reason, strict=True))
        return [(rollout[t], frame[t]) for t in selection.targets], said

    shuffled = list(stream)
    random.shuffle(shuffled)
    assert chosen(shuffled) == chosen(stream)


def test_a_random_ranking_is_its_seeds():
    frames = np.arange(400)
    settings = SelectionSettings(ranking="random")

    def drawn(seed):
        scores = np.linspace(0.0, 1.0, 400)
        rng = np.random.default_rng(seed)
        return select_targets(scores, np.ones(400), np.zeros(400), frames, settings, rng=rng)

    assert drawn(1).targets.tolist() == drawn(1).targets.tolist()
    assert drawn(1).targets.tolist() != drawn(2).targets.tolist()
    # Twenty draws know nothing of the scores: the targets' mean is that of all candidates.
    mean = np.mean([drawn(seed).score[drawn(seed).targets].mean() for seed in range(20)])
    assert 0.4 < mean < 0.6
    assert drawn(1).ablations == ("selection.ranking = random",)
    assert drawn(1).reason[drawn(1).targets[0]].startswith("drawn at random, number 1 of 12")


def test_candidates_named_twice_are_refused():
    with pytest.raises(ValueError, match="once"):
        select_targets([0.5, 0.4], [1.0, 1.0], [2, 2], [3, 3], FEW)


@given(streams, st.integers(1, 20))
def test_a_suppressor_is_near_and_no_worse(stream, window):
    rollout, frame, score, _ = np.array(stream, np.float64).reshape(-1, 4).T
    suppressor = temporal_nms(score, rollout, frame, window)
    assert (rollout[suppressor] == rollout).all()
    assert (np.abs(frame[suppressor] - frame) <= window).all()
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
    recorder = ProgressRecorder()
    selection = select_targets([0.5, 0.4], [1.0, 1.0], [0, 0], [0, 1], FEW, recorder)
    assert selection.targets.tolist() == [0]
    assert recorder.messages == [("warning", selection.note)]
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
    settings = SelectionSettings(target_views=3, nms_window=5, geometry="ignored")
    selection = select_targets(
        rng.random(40), rng.random(40), np.repeat([0, 1], 20), np.tile(np.arange(20), 2), settings
    )
    selection.save(tmp_path)
    loaded = Selection.load(tmp_path)
    for name in vars(selection):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(selection, name))
    words = json.loads((tmp_path / "selection.json").read_text())
    assert [entry["candidate"] for entry in words["targets"]] == selection.targets.tolist()


def test_a_selection_of_before_targets_were_chosen_together_is_read(tmp_path):
    select_targets([0.5, 0.1], [1.0, 1.0], [0, 1], [0, 0], FEW).save(tmp_path)
    with np.load(tmp_path / "selection.npz") as data:
        arrays = {name: data[name] for name in data if name != "marginal"}
    np.savez(tmp_path / "selection.npz", **arrays)
    np.testing.assert_array_equal(Selection.load(tmp_path).marginal, np.ones(2))


def test_candidates_survive_the_disk(tmp_path):
    lens = Camera(96, 72, 81.5, 82.5, 47.0, 36.5, np.eye(4))
    candidates = [lens.at(look_at([k, 0.0, 1.0], [k, 2.0, 0.3 * k])) for k in range(3)]
    save_candidates(tmp_path, candidates)
    assert [one.to_json() for one in load_candidates(tmp_path)] == [one.to_json() for one in candidates]
    with pytest.raises(GenerationError, match="no candidate views") as none:
        save_candidates(tmp_path, [])  # such as of rollouts whose cameras never turn slowly enough
    assert "episode.max_turn_deg_s" in none.value.cure
    (tmp_path / "candidates.json").write_text("{}")
    with pytest.raises(GenerationError, match=r"candidates\.json: these are not candidate views"):
        load_candidates(tmp_path)


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


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"reasons": 1}'])
def test_a_selection_whose_words_are_damaged_names_their_file(tmp_path, text):
    select_targets([0.5, 0.1], [1.0, 1.0], [0, 1], [0, 0], FEW).save(tmp_path)
    (tmp_path / "selection.json").write_text(text)
    with pytest.raises(GenerationError, match=r"selection\.json: this is not a selection"):
        Selection.load(tmp_path)


def test_a_selection_whose_numbers_have_other_axes_names_their_file(tmp_path):
    selection = select_targets([0.5, 0.1], [1.0, 1.0], [0, 1], [0, 0], FEW)
    replace(selection, overlaps=np.zeros((2, 3, 1))).save(tmp_path)
    with pytest.raises(GenerationError, match=r"selection\.npz: this is not a selection"):
        Selection.load(tmp_path)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rank": [0, 9, -1, -1]},
        {"rank": [0, 0, -1, -1]},
        {"rank": [0, 1, -1, -7]},
        {"chosen": [False, True, False, False]},
        {"chosen": [True, True, True, True]},
        {"reference": [-1, 1, -1, -1]},
        {"reference": [0, -1, -1, 0]},
        {"reference": [0, 3, -1, -1]},
        {"reference": [0, -5, -1, -1]},
        {"deficit": [0.9, np.nan, 0.1, 0.1]},
    ],
)
def test_ranks_choices_and_references_that_contradict_each_other_are_damage(tmp_path, wrong):
    selection = select_targets([0.9, 0.5, 0.0, 0.0], np.ones(4), [0, 1, 2, 3], np.zeros(4), FEW)
    overlaps = np.array([[0.5, 0.1, 0.0], [0.0, 0.6, 0.0], [0.0] * 3, [0.0] * 3])
    selection = replace(selection, reference=np.array([0, 1, -1, -1]), overlaps=overlaps)
    selection.save(tmp_path)
    assert Selection.load(tmp_path).targets.tolist() == [0, 1]
    replace(selection, **{name: np.array(values) for name, values in wrong.items()}).save(tmp_path)
    with pytest.raises(GenerationError, match=r"selection\.(npz|json): this is not a selection"):
        Selection.load(tmp_path)
