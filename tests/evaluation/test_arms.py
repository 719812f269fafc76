"""A gain is told against the strongest method of others, and a panel names every arm."""

from r2sego_blender.evaluation.arms import (
    ARMS,
    DEFAULT_ARMS,
    GAUSSGYM,
    GENFUSION,
    REFINED,
    SAME_POINTS,
    VANILLA,
    WITHOUT_GENERATED,
    strongest_baseline,
)
from r2sego_blender.results.panels.report_scores import ARM_LABELS


def test_the_strongest_baseline_is_the_best_method_of_others():
    scores = {VANILLA: 19.0, SAME_POINTS: 21.0, GAUSSGYM: 20.0, WITHOUT_GENERATED: 23.0, REFINED: 25.0}
    assert strongest_baseline(scores) == SAME_POINTS
    assert strongest_baseline(scores | {VANILLA: 21.5}) == VANILLA
    assert strongest_baseline(scores | {VANILLA: None}) == VANILLA  # equal images
    assert strongest_baseline({REFINED: 25.0}) == ""
    assert strongest_baseline(scores | {GENFUSION: 22.0}) == GENFUSION
    assert strongest_baseline(scores | {GENFUSION: 22.0}, DEFAULT_ARMS[:3]) == GAUSSGYM


def test_panels_have_a_word_for_every_arm():
    assert list(ARM_LABELS) == list(reversed(ARMS))
