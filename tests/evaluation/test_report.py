"""The report page: everything is on it, names cannot break it, nothing is loaded from afar."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from r2sego_blender.evaluation.report import write_report
from r2sego_blender.evaluation.report_data import (
    Arm,
    Backend,
    CandidateCurves,
    Collision,
    FrozenView,
    Rendering,
    ReportData,
    RolloutSummary,
    Round,
    SettingUsed,
    Target,
)

NASTY = '<script>alert("x")</script> & "room"'
VOID = {"meta", "img", "input", "br", "line", "circle", "polyline", "polygon"}


class Page(HTMLParser):
    """Collects what the page refers to, and checks that its tags are balanced."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.images: list[dict] = []
        self.references: list[str] = []
        self.scripts = 0
        self.ids: set[str] = set()
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.scripts += tag == "script"
        self.references += [found[key] for key in ("src", "href") if found.get(key)]
        self.ids |= {found["id"]} if "id" in found else set()
        if tag == "img":
            self.images.append(found)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def image(value: float) -> np.ndarray:
    return np.full((24, 32, 3), value, np.float32)


@pytest.fixture
def report() -> ReportData:
    rng = np.random.default_rng(2)
    u, g = rng.random((2, 700))
    curves = CandidateCurves(u, g, u * g, np.repeat(np.arange(7), 100), np.array([5, 340]))
    targets = (
        Target(
            "target_00",
            True,
            "registered",
            "capture_00",
            image(0.2),
            image(0.4),
            image(0.6),
            0.31,
            120,
            0.012,
            0.4,
        ),
        Target(
            "target_01",
            False,
            "only 9 inliers, fewer than 30",
            "capture_01",
            image(0.2),
            image(0.3),
            None,
            0.2,
            9,
        ),
    )
    rollouts = (RolloutSummary(7, True, "arrived", 8.5), RolloutSummary(8, False, "fell over"))
    rounds = tuple(
        Round(number, rollouts, curves, targets, image(0.7), image(0.8), "a note") for number in range(2)
    )
    arms = (
        Arm("initial", "Initial asset", 22.314, 0.751),
        Arm("vanilla_3dgs", "Vanilla 3DGS", 21.447, 0.774, note="six captures"),
        Arm("refined", "Refined asset", 26.191, 0.843),
    )
    renderings = tuple(Rendering(arm.key, image(0.5), arm.psnr, arm.ssim) for arm in arms)
    return ReportData(
        title="Demo room",
        facts=(("Seed", "0"),),
        arms=arms,
        lpips_reason="AlexNet weights not at hand",
        backends=(
            Backend("generator", "geometry-guided blending", False, "ViewCrafter"),
            Backend("registration", "VGGT at a GPU machine", True, "VGGT"),
        ),
        frozen=(
            FrozenView("frozen_00", image(0.1), renderings),
            FrozenView("frozen_01", image(0.1), renderings),
        ),
        rounds=rounds,
        provenance={"observed": 0.6, "prior": 0.1, "completed": 0.3},
        collision=Collision(1234, 56, 0.0, 1.5, (("compiles in MuJoCo", True), ("is watertight", False))),
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
        "is watertight",
        "1 of 2 differ",
        "1 min 01 s",
        "1 h 02 min",
        "60 %",
    )
    for part in expected:
        assert part in page.text, part


def test_pictures_lie_beside_the_page_and_have_alt_texts(tmp_path, report):
    path = write_report(tmp_path, report)
    page = Page(path.read_text(encoding="utf-8"))
    shown = [picture for picture in page.images if "src" in picture]
    assert len(shown) == 2 * 4 + 2 * (2 + 5)
    for picture in shown:
        assert picture["alt"].strip()
        assert (tmp_path / picture["src"]).stat().st_size > 0
    assert {picture["src"] for picture in shown} == {
        f"figures/{p.name}" for p in (tmp_path / "figures").iterdir()
    }


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
        rounds=(
            Round(
                0, (RolloutSummary(1, True, NASTY),), None, (Target(NASTY, False, NASTY, NASTY),), note=NASTY
            ),
        ),
        settings=(SettingUsed(NASTY, NASTY, NASTY, NASTY),),
        timings=((NASTY, 1.0),),
        collision=Collision(1, 1, checks=((NASTY, True),)),
    )
    ordinary = Page(write_report(tmp_path / "ordinary", report).read_text(encoding="utf-8"))
    page = Page(write_report(tmp_path / "nasty", nasty).read_text(encoding="utf-8"))
    assert page.open == []
    assert page.scripts == ordinary.scripts
    assert page.text.count(NASTY) >= 12
    assert {path.parent.name for path in (tmp_path / "nasty").rglob("*.jpg")} == {"figures"}


def test_an_empty_report_is_a_page_too(tmp_path):
    page = Page(write_report(tmp_path, ReportData("Nothing yet")).read_text(encoding="utf-8"))
    assert page.open == []
    assert "Nothing yet" in page.text


def test_scores_that_are_missing_or_infinite_are_said_so(tmp_path):
    arms = (Arm("vanilla_3dgs", "Vanilla", None, None), Arm("refined", "Refined", float("inf"), 1.0, 0.0))
    text = Page(write_report(tmp_path, ReportData("Room", arms=arms)).read_text(encoding="utf-8")).text
    assert "n/a" in text
    assert "∞" in text


def test_a_lost_picture_and_an_old_figure_do_no_harm(tmp_path, report):
    write_report(tmp_path, report)
    lost = replace(
        report,
        rounds=(),
        frozen=(FrozenView("frozen_00", tmp_path / "gone.png", (Rendering("refined", image(0.5)),)),),
    )
    page = Page(write_report(tmp_path, lost).read_text(encoding="utf-8"))
    assert "no picture" in page.text
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["frozen-frozen-00-refined.jpg"]


def test_the_report_is_the_same_bytes_again(tmp_path, report):
    first = write_report(tmp_path / "a", report).read_bytes()
    assert write_report(tmp_path / "b", report).read_bytes() == first
