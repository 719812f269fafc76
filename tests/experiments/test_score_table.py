"""Figures of tables are those of independent implementations, and only of what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from r2sego_blender.evaluation.arms import ARMS, REFINED, SAME_POINTS, VANILLA, WITHOUT_GENERATED
from r2sego_blender.experiments.capture_curve import catching_up, curve_figure, curves_of
from r2sego_blender.experiments.score_table import (
    ALL_SCENES,
    Measured,
    latex,
    markdown,
    rows_of,
    tables_of,
    worth_of_views,
)

psnrs = st.lists(st.floats(5.0, 50.0), min_size=5, max_size=5)


def measured(arm, seed, psnr, scene="room", captures=6, preset="paper", views=None, ssim=0.8):
    scores = {"psnr": psnr, "ssim": ssim}
    return Measured(preset, scene, captures, seed, arm, scores, views or {"a": psnr - 1.0, "b": psnr + 1.0})


def row(rows, arm, scene="room", captures=6, preset="paper"):
    (found,) = [r for r in rows if (r.arm, r.scene, r.captures, r.preset) == (arm, scene, captures, preset)]
    return found


@given(psnrs, psnrs, psnrs)
def test_spreads_and_paired_intervals_are_scipys(vanilla, same, refined):
    arms = {VANILLA: vanilla, SAME_POINTS: same, REFINED: refined}
    rows = rows_of([measured(arm, seed, psnr) for arm, of in arms.items() for seed, psnr in enumerate(of)])
    best = VANILLA if np.mean(vanilla) >= np.mean(same) else SAME_POINTS
    found = row(rows, REFINED)
    assert found.spreads["psnr"].mean == pytest.approx(np.mean(refined))
    assert found.spreads["psnr"].std == pytest.approx(np.std(refined, ddof=1))
    apart = np.array(refined) - np.array(arms[best])
    assert found.difference.mean == pytest.approx(apart.mean()) and found.difference.pairs == 5
    if apart.std() > 1e-6:
        expected = stats.ttest_rel(refined, arms[best]).confidence_interval(0.95)
        np.testing.assert_allclose(found.difference.interval, expected, rtol=1e-6, atol=1e-6)
    assert row(rows, best).difference is None


def test_the_error_over_views_is_that_of_views_averaged_over_seeds():
    views = [{"a": 20.0, "b": 24.0, "c": 28.0}, {"a": 22.0, "b": 24.0, "c": 32.0}]
    (found,) = rows_of([measured(REFINED, seed, 24.0, views=of) for seed, of in enumerate(views)])
    assert found.views == 3 and found.sem_db == pytest.approx(stats.sem([21.0, 24.0, 30.0]))
    assert found.difference is None  # without a method of others


def test_one_seed_has_no_deviation_and_no_interval():
    rows = rows_of([measured(VANILLA, 3, 20.0), measured(REFINED, 3, 24.0)])
    found = row(rows, REFINED)
    assert found.spreads["psnr"].std is None and found.difference.interval is None and found.difference.mean == 4.0
    assert "+4.00 to vanilla 3DGS" in markdown(rows, ()) and "±" not in markdown(rows, ()).split("\n- ")[0]


def test_over_all_scenes_only_seeds_count_that_all_have():
    of_scenes = {"a": {seed: (20.0 + seed, 25.0 + seed) for seed in (0, 1, 2)}}
    of_scenes["b"] = {seed: (10.0 + 3 * seed, 11.0 + 3 * seed) for seed in (0, 2)}
    own = [
        measured(arm, seed, psnr, scene)
        for scene, seeds in of_scenes.items()
        for seed, both in seeds.items()
        for arm, psnr in zip((VANILLA, REFINED), both, strict=True)
    ]
    rows = rows_of([*own, measured(REFINED, 0, 30.0, "a", captures=10)])
    found = row(rows, REFINED, ALL_SCENES)
    assert found.by_seed == {0: 18.0, 2: 22.0} and found.difference.mean == pytest.approx(3.0)
    assert found.difference.interval == (3.0, 3.0) and found.sem_db is None
    assert not [one for one in rows if (one.scene, one.captures) == (ALL_SCENES, 10)]


def test_presets_are_told_against_the_first_seed_by_seed():
    of_presets = {"ours": (25.0, 26.0), "one_round": (24.5, 24.5)}
    rows = rows_of(
        [
            measured(REFINED, seed, psnr, preset=preset)
            for preset, of in of_presets.items()
            for seed, psnr in enumerate(of)
        ]
    )
    assert row(rows, REFINED, preset="ours").to_preset is None
    apart = row(rows, REFINED, preset="one_round").to_preset
    assert (apart.to, apart.mean, apart.pairs) == ("ours", -1.0, 2)
    assert "difference to ours, dB" in markdown(rows, ())


def test_what_generated_views_are_worth_is_told():
    rows = rows_of(
        [measured(arm, seed, psnr) for seed in (0, 1) for arm, psnr in ((WITHOUT_GENERATED, 24.0), (REFINED, 24.5))]
    )
    (told,) = worth_of_views(rows)
    assert "+0.50 [+0.50, +0.50] to no generated views" in told


def test_equal_images_are_said_and_have_no_difference():
    rows = rows_of([measured(VANILLA, 0, 20.0), measured(REFINED, 0, np.inf)])
    assert row(rows, REFINED).difference is None and "equal images" in markdown(rows, ())


def test_markdown_and_latex_have_a_row_for_each_and_escape_names():
    rows = rows_of([measured(arm, 0, 20.0, scene="a_b|c") for arm in (VANILLA, REFINED)])
    table, tex = markdown(rows, ("100 % of it",)), latex(rows, ("100 % of it",))
    lines = [line for line in table.splitlines() if line.startswith("| a_b")]
    assert len(lines) == 2 and all(line.startswith(r"| a_b\|c | 6 |") for line in lines)
    cells = [line.count("&") for line in tex.splitlines() if line.rstrip().endswith(r"\\")]
    assert cells == [8] * 3 and r"a\_b|c" in tex and r"% 100 \% of it" in tex
    assert tex.count(r"\begin{tabular}") == tex.count(r"\end{tabular}") == 1


def test_regions_and_geometry_have_columns_and_a_table_where_some_were_measured():
    plain = [measured(VANILLA, seed, 20.0) for seed in (0, 1)]
    assert not {"seen", "geometry"} & set(markdown(rows_of(plain), ()).replace(",", " ").split())
    figures = [{"psnr_seen": 26.0 + seed, "psnr_unseen": 15.0, "proxy_fscore": 0.8 + 0.1 * seed} for seed in (0, 1)]
    told = [
        replace(one, scores={**one.scores, **figures[one.seed]}) for one in (measured(REFINED, s, 24.0) for s in (0, 1))
    ]
    rows = rows_of([*plain, *told])
    main, geometry = tables_of(rows)
    assert main.head[6:8] == ("seen, dB", "unseen, dB") and geometry.head[3:] == ("proxy F",)
    by_arm = {cells[2]: cells for cells in main.cells}
    assert by_arm["refined"][6:8] == ("26.50 ± 0.71", "15.00 ± 0.00") and by_arm["vanilla 3DGS"][6:8] == ("-", "-")
    assert [cells[2:] for cells in geometry.cells] == [("refined", "0.850 ± 0.071")]
    table, tex = markdown(rows, ()), latex(rows, ())
    assert "### paper, geometry" in table and tex.count(r"\begin{tabular}") == 2
    assert "Seen, unseen" in table and "F-score" in table and "Seen, unseen" in tex


def test_corrected_colours_have_a_column_where_they_were_told():
    plain = [measured(VANILLA, seed, 20.0) for seed in (0, 1)]
    told = [replace(one, scores={**one.scores, "psnr_corrected": 21.5}) for one in plain]
    (main,) = tables_of(rows_of(told))
    assert main.head[6] == "cc PSNR, dB" and main.cells[0][6] == "21.50 ± 0.00"
    assert "cc:" in markdown(rows_of(told), ()) and "cc:" not in markdown(rows_of(plain), ())


def test_a_seed_that_lacks_a_figure_leaves_it_out_of_the_row():
    whole = measured(REFINED, 0, 24.0)
    rows = rows_of([replace(whole, scores={**whole.scores, "psnr_unseen": 15.0}), measured(REFINED, 1, 25.0)])
    assert "psnr_unseen" not in row(rows, REFINED).spreads


def strongest(**psnrs):
    """Of baselines by seed, whom refined is told against."""
    rows = rows_of([measured(arm, seed, psnr) for arm, of in psnrs.items() for seed, psnr in of.items()])
    return row(rows, REFINED).difference


def test_the_strongest_is_so_by_the_seeds_that_all_have():
    found = strongest(vanilla_3dgs={0: 20.0, 1: 10.0}, gaussgym={0: 18.0}, refined={0: 21.0, 1: 12.0})
    assert (found.to, found.mean, found.pairs) == ("vanilla 3DGS", 1.5, 2)
    found = strongest(vanilla_3dgs={0: 20.0, 1: 30.0}, gaussgym={0: 22.0}, refined={0: 21.0, 1: 32.0})
    assert (found.to, found.mean, found.pairs) == ("GaussGym condition", -1.0, 1)


def test_a_baseline_that_shares_no_seed_with_others_is_not_the_strongest():
    found = strongest(genfusion={7: 50.0}, vanilla_3dgs={0: 20.0, 1: 10.0}, refined={0: 21.0, 1: 12.0, 7: 40.0})
    assert (found.to, found.pairs) == ("vanilla 3DGS", 2)


def curve(*by_count):
    """Rows of (captures, vanilla, refined)."""
    of = [(count, arm, psnr) for count, *both in by_count for arm, psnr in zip((VANILLA, REFINED), both, strict=True)]
    ((_, rows),) = curves_of(rows_of([measured(arm, 0, psnr, captures=count) for count, arm, psnr in of])).items()
    return rows


def test_the_count_at_which_a_baseline_catches_up_is_a_measured_one():
    rows = curve((6, 18.0, 24.0), (10, 21.0, 25.0), (30, 24.0, 26.0), (45, 23.0, 27.0))
    assert catching_up(rows).endswith("(24.00 dB) with 30.")
    rows = curve((6, 18.0, 24.0), (45, 23.9, 27.0))
    assert "no baseline measured, up to 45 captures" in catching_up(rows)
    assert not curves_of(rows_of([measured(REFINED, 0, 20.0)]))


def test_the_figure_has_a_point_for_every_measured_row():
    from xml.etree import ElementTree

    rows = curve((6, 18.0, 24.0), (10, 21.0, 25.0), (45, 23.0, 26.0))
    drawn = ElementTree.fromstring(curve_figure(rows))
    lines = drawn.findall("{*}polyline")
    assert [len(line.get("points").split()) for line in lines] == [3, 3]
    titles = [title.text for title in drawn.findall("{*}circle/{*}title")]
    assert "refined, 45 captures: 26.00 dB" in titles and len(titles) == 6
    heights = {float(point.split(",")[1]): None for point in lines[1].get("points").split()}
    assert list(heights) == sorted(heights, reverse=True)  # higher PSNR stands higher


def test_a_baseline_catches_up_by_the_seeds_that_it_shares_with_refined():
    own = [measured(REFINED, seed, psnr) for seed, psnr in ((0, 30.0), (1, 20.0))]
    own += [measured(VANILLA, 0, 28.0, captures=10), measured(VANILLA, 5, 40.0, captures=15)]
    ((_, rows),) = curves_of(rows_of(own)).items()
    assert "no baseline measured, up to 10 captures" in catching_up(rows)  # 28 beats the mean of 25, not 30
    ((_, rows),) = curves_of(rows_of([*own, measured(VANILLA, 1, 20.5, captures=45)])).items()
    assert catching_up(rows).endswith("with 45.")


def colours(arms):
    """The colour of each arm's line in a figure of these arms."""
    from xml.etree import ElementTree

    rows = rows_of([measured(arm, 0, 20.0, captures=count) for arm in arms for count in (6, 10)])
    ((_, own),) = curves_of(rows).items()
    lines = ElementTree.fromstring(curve_figure(own)).findall("{*}polyline")
    return dict(zip([arm for arm in ARMS if arm in arms], [line.get("stroke") for line in lines], strict=True))


SEEN_BY_THOSE_WITHOUT = {  # linear RGB: Machado, Oliveira and Fernandes 2009, severity 1
    "nothing": np.eye(3),
    "red": np.array([[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.052]]),
    "green": np.array([[0.3673, 0.8606, -0.2279], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]]),
}


@pytest.mark.parametrize("seen", SEEN_BY_THOSE_WITHOUT.values(), ids=SEEN_BY_THOSE_WITHOUT)
def test_every_arm_has_a_colour_of_its_own_in_all_figures_told_apart_by_everybody(seen):
    every = colours(list(ARMS))
    assert colours([VANILLA, REFINED]) == {arm: every[arm] for arm in (VANILLA, REFINED)}
    values = np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in every.values()]) / 255.0
    linear = np.clip(np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4) @ seen.T, 0.0, 1.0)
    xyz = linear @ np.array([[0.4339, 0.2126, 0.0177], [0.3762, 0.7152, 0.1095], [0.1899, 0.0722, 0.8728]])
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    lab = np.stack([116.0 * f[:, 1] - 16.0, 500.0 * (f[:, 0] - f[:, 1]), 200.0 * (f[:, 1] - f[:, 2])], axis=1)
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=2)[np.triu_indices(len(ARMS), 1)]
    assert len(apart) == 28 and apart.min() > 15.0


def test_a_deviation_of_nothing_is_one_and_has_no_bar():
    own = [measured(REFINED, seed, 20.0, captures=count) for seed in (0, 1) for count in (6, 10)]
    ((_, rows),) = curves_of(rows_of(own)).items()
    assert rows[0].spreads["psnr"].std == 0.0 and rows[0].sem_db > 0.5 and "<path" not in curve_figure(rows)
    ((_, rows),) = curves_of(rows_of([one for one in own if one.seed == 0])).items()
    assert curve_figure(rows).count("<path") == 2
