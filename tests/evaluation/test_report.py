"""The report page: everything is on it, names cannot break it, nothing is loaded from afar."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from html_page import Page
from PIL import Image

from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.evaluation.frozen_pictures import read_frozen_pictures
from r2sego_blender.evaluation.report import write_report
from r2sego_blender.evaluation.report_data import (
    Arm,
    Backend,
    CandidateCurves,
    CausesOfView,
    Collision,
    ErrorCause,
    ErrorSplit,
    FrozenView,
    Rendering,
    ReportData,
    RolloutSummary,
    Round,
    ScoredRound,
    SettingUsed,
    Target,
)

NASTY = '<script>alert("x")</script> & "room"'


def image(value: float) -> np.ndarray:
    return np.full((24, 32, 3), value, np.float32)


@pytest.fixture
def report() -> ReportData:
    rng = np.random.default_rng(2)
    u, g = rng.random((2, 700))
    curves = CandidateCurves(u, g, u * g, np.repeat(np.arange(7), 100), np.array([5, 340]))
    targets = (
        Target(
            "target_00", True, "registered", "capture_00", image(0.2), image(0.4), image(0.6), 0.31, 120, 0.012, 0.4
        ),
        Target("target_01", False, "only 9 inliers, fewer than 30", "capture_01", image(0.2), image(0.3), None, 0.2, 9),
    )
    rollouts = (RolloutSummary(7, True, "arrived", 8.5), RolloutSummary(8, False, "fell over"))
    rounds = tuple(Round(number, rollouts, curves, targets, image(0.7), image(0.8), "a note") for number in range(2))
    arms = (
        Arm("initial", "Initial asset", 22.314, 0.751),
        Arm("vanilla_3dgs", "Vanilla 3DGS", 21.447, 0.774, note="six captures"),
        Arm("refined", "Refined asset", 26.191, 0.843),
    )
    renderings = tuple(Rendering(arm.key, image(0.5), arm.psnr, arm.ssim) for arm in arms)
    truth = image(0.1)
    causes = (
        ErrorCause("wrong depth", "off the room", "shape priors", (0.8, 0.4, 0.0), 0.63, 0.25, 17.31),
        ErrorCause("edges", "near an edge", "finer splats", (0.9, 0.8, 0.2), 0.37, 0.75, None),
    )
    worst = CausesOfView("frozen_01", truth, renderings[2].picture, image(0.9), 24.12, "wrong depth 71 %")
    return ReportData(
        title="Demo room",
        scored_rounds=(
            ScoredRound(0, 25.507, 0.831),
            ScoredRound(1, 25.297, 0.829, "0.21 dB below round 0"),
            ScoredRound(2, None, None, missing="rounds/2/asset.ply is not there"),
            ScoredRound(3, 26.191, 0.843),
        ),
        error_split=ErrorSplit("the true room's mesh", causes, (worst,), "a note of the causes"),
        facts=(("Seed", "0"),),
        arms=arms,
        lpips_reason="AlexNet weights not at hand",
        backends=(
            Backend("generator", "geometry-guided blending", False, "ViewCrafter"),
            Backend("registration", "VGGT at a GPU machine", True, "VGGT"),
        ),
        frozen=(FrozenView("frozen_00", image(0.1), renderings), FrozenView("frozen_01", truth, renderings)),
        rounds=rounds,
        provenance={"observed": 0.6, "prior": 0.1, "completed": 0.3},
        collision=Collision(1234, 56),
        settings=(SettingUsed("seed", "0", "0", "Seed."), SettingUsed("rounds", "2", "3", "Rounds.")),
        timings=(("Dense stereo", 61.0), ("Training", 3725.0)),
    )


def test_the_page_names_every_part(tmp_path, report):
    path = write_report(tmp_path / "report", report)
    assert path == tmp_path / "report" / "index.html"
    page = Page(path.read_text(encoding="utf-8"))
    assert page.open == []
    for arm in report.arms:
        assert arm.label in page.text
        assert f"{arm.psnr:.2f}" in page.text
        assert f"{arm.ssim:.3f}" in page.text
    expected = (
        "+4.74 dB against Vanilla 3DGS",
        "AlexNet weights not at hand",
        "six captures",
        "fell over",
        "arrived",
        "only 9 inliers, fewer than 30",
        "registered",
        "1.2 cm",
        "geometry-guided blending",
        "embedded default",
        "VGGT at a GPU machine",
        "1234",
        "1 of 2 differ",
        "1 min 01 s",
        "1 h 02 min",
        "60 %",
        "0.21 dB below round 0",
        "rounds/2/asset.ply is not there",
        "Told by the true room's mesh",
        "a note of the causes",
        "shape priors",
        "63 %",
        "17.31",
        "Error: wrong depth 71 %",
        "Refined: 24.12 dB",
    )
    for part in expected:
        assert part in page.text, part


def test_what_became_of_views_and_attempts_is_said_once(tmp_path, report):
    one = report.rounds[0]
    assert "1 kept of 2 views tried" in told(tmp_path / "plain", report)
    assert "stand-ins" not in told(tmp_path / "plain", report)
    refused = replace(one.targets[1], verdict="rejected: 20 of 20 patches agree, 30 are needed")
    for count, said in (
        (1, "1 kept of 3 views tried (2 targets, 1 stand-in)"),
        (5, "1 kept of 7 views tried (2 targets, 5 stand-ins)"),
    ):
        more = replace(one, targets=(*one.targets, *[refused] * count))
        text = told(tmp_path / "more", replace(report, rounds=(more,)))
        assert said in text
    assert "rejected 20 of 20 patches agree" in text and "rejected: " not in text
    assert "Attempt Outcome Behaviour and reason" in text and "Seed Outcome" not in text


def told(folder, report) -> str:
    """The page's words, a space between any two."""
    html = write_report(folder, report).read_text(encoding="utf-8")
    return " ".join(re.sub(r"<[^>]*>", " ", html).split())


def test_pictures_lie_beside_the_page_and_have_alt_texts(tmp_path, report):
    path = write_report(tmp_path, report)
    page = Page(path.read_text(encoding="utf-8"))
    shown = [picture for picture in page.images if "src" in picture]
    assert len(shown) == 2 * 4 + 2 * (2 + 5) + 3
    for picture in shown:
        assert picture["alt"].strip()
        assert (tmp_path / picture["src"]).stat().st_size > 0
    assert {picture["src"] for picture in shown} == {f"figures/{p.name}" for p in (tmp_path / "figures").iterdir()}


def test_what_no_capture_saw_lies_over_the_pictures_and_files_are_found_again(tmp_path, report):
    mask = np.zeros((24, 32), bool)
    mask[5:15, 8:20] = True
    first, second = report.frozen
    renderings = (replace(first.renderings[0], psnr_seen=27.5, psnr_unseen=13.25), *first.renderings[1:])
    frozen = (replace(first, name="a b", renderings=renderings, unseen=mask), replace(second, name="a-b"))
    text = write_report(tmp_path, replace(report, frozen=frozen, error_split=None)).read_text(encoding="utf-8")
    assert "; seen 27.50, unseen 13.25" in text and "What no capture saw" in text
    pictures = read_frozen_pictures(tmp_path / "frozen.json")
    with Image.open(pictures["a b"].unseen) as drawn:
        opacity = np.asarray(drawn.convert("RGBA"))[..., 3]
    np.testing.assert_array_equal(opacity > 0, mask)
    assert opacity[5, 10] == 255 > opacity[10, 12] > 0
    assert pictures["a-b"].unseen is None and f'data-unseen="figures/{pictures["a b"].unseen.name}"' in text
    assert len({place for view in pictures.values() for place in (view.truth, *view.arms.values())}) >= 4
    write_report(tmp_path, replace(report, frozen=()))
    assert not read_frozen_pictures(tmp_path / "frozen.json") and not list((tmp_path / "figures").glob("*.png"))


@pytest.mark.parametrize("listed", ["[1]", '{"a": {"truth": "../x.jpg", "arms": {}, "unseen": ""}}', '{"a": {}}', ""])
def test_a_list_of_pictures_that_lie_elsewhere_is_refused(tmp_path, listed):
    (tmp_path / "frozen.json").write_text(listed)
    with pytest.raises(EvaluationError, match=r"frozen\.json"):
        read_frozen_pictures(tmp_path / "frozen.json")


def test_nothing_comes_from_a_network_and_links_lead_somewhere(tmp_path, report):
    text = write_report(tmp_path, report).read_text(encoding="utf-8")
    page = Page(text)
    assert not re.search(r"(?:https?:)?//[a-z]", re.sub(r"^\s*//.*$", "", text, flags=re.MULTILINE))
    for reference in page.references:
        assert reference.startswith(("figures/", "#"))
        assert not reference.startswith("#") or reference[1:] in page.ids


def test_names_cannot_become_html(tmp_path, report):
    nasty = replace(
        report,
        title=NASTY,
        about=NASTY,
        facts=((NASTY, NASTY),),
        arms=(Arm("vanilla_3dgs", NASTY, 20.0, 0.5, note=NASTY), Arm("refined", NASTY, 21.0, 0.6)),
        backends=(Backend(NASTY, NASTY, False, NASTY),),
        frozen=(FrozenView(NASTY, image(0.1), (Rendering("refined", image(0.2)),)),),
        scored_rounds=(ScoredRound(0, 20.0, 0.5, NASTY), ScoredRound(1, None, None, missing=NASTY)),
        error_split=ErrorSplit(
            NASTY,
            (ErrorCause(NASTY, NASTY, NASTY, (0.1, 0.2, 0.3), 1.0, 1.0, 20.0),),
            (CausesOfView(NASTY, image(0.1), image(0.2), image(0.3), 20.0, NASTY),),
            NASTY,
        ),
        rounds=(Round(0, (RolloutSummary(1, True, NASTY),), None, (Target(NASTY, False, NASTY, NASTY),), note=NASTY),),
        settings=(SettingUsed(NASTY, NASTY, NASTY, NASTY),),
        timings=((NASTY, 1.0),),
    )
    ordinary = Page(write_report(tmp_path / "ordinary", report).read_text(encoding="utf-8"))
    page = Page(write_report(tmp_path / "nasty", nasty).read_text(encoding="utf-8"))
    assert page.open == []
    assert page.scripts == ordinary.scripts
    assert page.text.count(NASTY) >= 20
    assert {path.parent.name for path in (tmp_path / "nasty").rglob("*.jpg")} == {"figures"}


def test_an_empty_report_is_a_page_too(tmp_path):
    page = Page(write_report(tmp_path, ReportData("Nothing yet")).read_text(encoding="utf-8"))
    assert page.open == []
    assert "Nothing yet" in page.text


def test_a_round_that_fell_is_marked_and_stands_apart_in_the_chart(tmp_path, report):
    text = write_report(tmp_path, report).read_text(encoding="utf-8")
    rows = re.findall(r'<th scope="row">Round (\d).*?</tr>', text, flags=re.DOTALL)
    assert rows == ["0", "1", "2", "3"]
    chips = re.findall(r'<span class="chip bad">([^<]*below[^<]*)</span>', text)
    assert chips == ["0.21 dB below round 0"]
    points = re.findall(r'<circle class="(point(?: fell)?)" cx="([\d.]+)" cy="([\d.]+)"', text)
    assert [kind for kind, _, _ in points] == ["point", "point fell", "point"]
    xs, ys = np.array([place for _, *place in points], float).T
    np.testing.assert_allclose(np.diff(xs)[1], 2 * np.diff(xs)[0], atol=0.2)  # round 2 leaves its place free
    assert ys[2] < ys[0] < ys[1]  # higher PSNR is further up


def test_a_single_round_has_a_table_and_no_chart(tmp_path, report):
    one = replace(report, scored_rounds=(ScoredRound(0, 25.507, 0.831),))
    page = Page(write_report(tmp_path, one).read_text(encoding="utf-8"))
    assert "Round 0" in page.text and "25.51" in page.text and "below round" not in page.text
    assert 'class="point"' not in (tmp_path / "index.html").read_text(encoding="utf-8")


def test_the_stacked_bar_has_the_causes_shares(tmp_path, report):
    text = write_report(tmp_path, report).read_text(encoding="utf-8")
    stacks = re.findall(r'<div class="stack">(.*?)</div>', text, flags=re.DOTALL)
    widths = [[float(w) for w in re.findall(r"width: ([\d.]+)%", stack)] for stack in stacks]
    assert widths == [[63.0, 37.0], [25.0, 75.0]]
    assert stacks[0].count("rgb(204 102 0)") == 1


def test_causes_that_cannot_be_told_are_said(tmp_path, report):
    unknown = ErrorCause("wrong depth", "off the room", "shape priors", (0.8, 0.4, 0.0))
    split = ErrorSplit("the proxy alone", (unknown, *report.error_split.causes[1:]))
    page = Page(write_report(tmp_path, replace(report, error_split=split)).read_text(encoding="utf-8"))
    assert page.open == []
    assert "cannot be told without the true room's mesh" in page.text and "Told by the proxy alone" in page.text
    lost = replace(report, error_split=ErrorSplit(unavailable="the proxy is missing"))
    page = Page(write_report(tmp_path, lost).read_text(encoding="utf-8"))
    assert "Not available: the proxy is missing" in page.text and page.open == []


def test_scores_that_are_missing_or_infinite_are_said_so(tmp_path):
    arms = (Arm("vanilla_3dgs", "Vanilla", None, None), Arm("refined", "Refined", float("inf"), 1.0, 0.0))
    text = Page(write_report(tmp_path, ReportData("Room", arms=arms)).read_text(encoding="utf-8")).text
    assert "n/a" in text
    assert "∞" in text


def test_corrected_colours_have_a_column_where_exposures_differ(tmp_path):
    arms = (Arm("vanilla_3dgs", "Vanilla", 14.1, 0.5, psnr_corrected=16.74), Arm("refined", "Refined", 15.0, 0.6))
    text = Page(write_report(tmp_path, ReportData("Room", arms=arms)).read_text(encoding="utf-8")).text
    assert "cc PSNR" in text and "16.74" in text
    without = (replace(arms[0], psnr_corrected=None), arms[1])
    assert "cc PSNR" not in write_report(tmp_path, ReportData("Room", arms=without)).read_text(encoding="utf-8")


def test_a_lost_picture_and_an_old_figure_do_no_harm(tmp_path, report):
    write_report(tmp_path, report)
    lost = replace(
        report,
        rounds=(),
        error_split=None,
        frozen=(FrozenView("frozen_00", tmp_path / "gone.png", (Rendering("refined", image(0.5)),)),),
    )
    page = Page(write_report(tmp_path, lost).read_text(encoding="utf-8"))
    assert "no picture" in page.text
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["frozen-frozen-00-refined.jpg"]


def test_a_picture_cut_off_as_it_is_written_leaves_the_one_before(tmp_path, report, monkeypatch):
    write_report(tmp_path, report)
    before = {path.name: path.read_bytes() for path in (tmp_path / "figures").iterdir()}

    def cut_off(path, picture):
        path.write_bytes(b"half a picture")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("r2sego_blender.evaluation.report.save_figure", cut_off)
        write_report(tmp_path, report)
    assert {name: (tmp_path / "figures" / name).read_bytes() for name in before} == before
    write_report(tmp_path, report)
    assert {path.name: path.read_bytes() for path in (tmp_path / "figures").iterdir()} == before


def test_the_report_is_the_same_bytes_again(tmp_path, report):
    first = write_report(tmp_path / "a", report).read_bytes()
    assert write_report(tmp_path / "b", report).read_bytes() == first
