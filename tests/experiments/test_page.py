"""The page of an experiment holds all it shows, worst views first, and no more pictures than it may."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import os
import re
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest
from bundles import new_bundle
from html_page import Page
from PIL import Image

from r2sego_blender.evaluation.report import write_report
from r2sego_blender.evaluation.report_data import FrozenView, Rendering, ReportData
from r2sego_blender.evaluation.scene_causes import CAUSES
from r2sego_blender.evaluation.surfaces.figures import PROXY_ALONE, SEEN_BY, TRUE_ROOM
from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.gathering import gather
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.page import PAGE
from r2sego_blender.experiments.page_pictures import shown_cells, within_bound
from r2sego_blender.experiments.records import Record, Stage

NAMES = ("20.png", "21.png")
ASSETS = {"asset.ply": "1" * 64}
SHARES = [
    {"cause": name, "error": None if name == "wrong_depth" else 0.25, "pixels": 0.2, "psnr": 20.0} for name in CAUSES
]


def scored(seed: int, base: float) -> dict:
    """An arm's scores; the second view is the worse."""
    views = [
        {"name": name, "psnr": base - index, "ssim": 0.5, "psnr_seen": base + 1.0, "psnr_unseen": 11.5, "unseen": 0.25}
        for index, name in enumerate(NAMES)
    ]
    geometry = {"depth_error": 0.0125, "depth_right": 0.9, "proxy_fscore": 0.8765}
    whole = {"psnr": base + 0.1 * seed, "ssim": 0.5, "lpips_alex": None, "psnr_seen": base + 1.0, "psnr_unseen": 11.5}
    return {**whole, "unseen": 0.25, SEEN_BY: TRUE_ROOM, **geometry, "views": views}


def pictures(arms: tuple[str, ...]) -> tuple[FrozenView, ...]:
    rng = np.random.default_rng(len(arms))
    mask = np.arange(32) < 8
    return tuple(
        FrozenView(
            name,
            rng.random((24, 32, 3)).astype(np.float32),
            tuple(Rendering(arm, rng.random((24, 32, 3)).astype(np.float32)) for arm in arms),
            np.broadcast_to(mask, (24, 32)),
        )
        for name in NAMES
    )


@pytest.fixture
def done(plan, tmp_path):
    """The plan's cells with bundles that have reports, and their records."""
    cells = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    records = {}
    for cell in cells:
        cell.folder.mkdir(parents=True)
        bundle = new_bundle(cell.bundle)
        write_report(bundle.made_folder("report"), ReportData("a room", frozen=pictures(cell.arms)))
        causes = {"told_by": PROXY_ALONE, "shares": SHARES}
        bundle.metrics_file.write_text(json.dumps({"arms": {}, "assets": ASSETS, "causes": causes}))
        arms = {arm: scored(cell.seed, 20.0 + 2 * index + cell.captures) for index, arm in enumerate(cell.arms)}
        stages = (Stage("refine", 10.0 + cell.seed, 9.0, 800.0), Stage("evaluate", 3.0, None, None))
        records[cell.folder] = Record(cell.key, arms, ASSETS, stages, {"asset.ply": 2.5}, {"version": "1"}, 1.0)
    return plan, cells, records, tmp_path / "out"


def text_of(plan, cells, records, folder) -> str:
    gather(plan, cells, records, folder)
    return (folder / PAGE).read_text(encoding="utf-8")


def test_everything_is_on_the_page_and_nothing_beside_it(done):
    text = text_of(*done)
    page = Page(text)
    assert page.open == [] and page.scripts == 1
    for reference in page.references:
        assert reference.startswith("data:image/") or reference[1:] in page.ids
    words = re.sub(r"base64,[^\"]*|^\s*//.*$|xmlns=\S+", "", text, flags=re.MULTILINE)
    assert not re.search(r"(?:https?:)?//[a-z]", words) and "url(" not in words
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
    script = re.search(r"<script>(.*?)</script>", text, flags=re.DOTALL).group(1)
    sha256 = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy.startswith("default-src 'none'; img-src data:;") and f"script-src 'sha256-{sha256}'" in policy

    shown = [image for image in page.images if "src" in image]
    assert len(shown) == 2 * 2 * (1 + 3) and all(image["alt"].strip() for image in shown)  # counts, views, arms
    with Image.open(io.BytesIO(base64.b64decode(shown[0]["src"].partition(",")[2]))) as picture:
        assert (picture.format, picture.size) == ("JPEG", (32, 24))
    assert text.count('data-unseen="data:image/png;base64,') == 4 and text.count('class="viewer card"') == 2
    assert text.count("<svg") == 1 and "initial asset" not in page.text
    for part in (
        "4 of 4 cells done",
        "Seed 0. 2 frozen views, worst first by refined. 25% of the pixels were seen by no capture",
        "refined: 27.00 dB, SSIM 0.500; seen 28.00, unseen 11.50",
        "0.876",  # F-score of the proxy, with mean and deviation
        "refine 10.5 ± 0.7 s, 800 MB",
        "Told by the proxy alone",
        "no capture saw 25.0% with 3 captures, 25.0% with 5 captures of the frozen views' pixels, told by the true",
    ):
        assert part in page.text, part
    order = re.findall(r'<article class="view" data-name="([^"]+)"', text)
    assert order == [*reversed(NAMES)] * 2


def test_the_page_is_the_same_bytes_again_and_of_the_first_seed_that_is_done(done):
    plan, cells, records, folder = done
    first = text_of(*done)
    assert text_of(plan, cells, dict(reversed(records.items())), folder) == first
    later = {place: record for place, record in records.items() if place.name == "seed_1"}
    assert text_of(plan, cells, later, folder).count("Seed 1. ") == 2
    assert "No cell is done yet" in text_of(plan, cells, {}, folder)


def test_a_bundle_that_is_gone_or_another_has_no_pictures_and_says_so(done):
    plan, cells, records, folder = done
    shutil.rmtree(cells[0].bundle)
    (cells[1].bundle / "report/metrics.json").write_text(json.dumps({"assets": {"asset.ply": "2" * 64}}))
    text = text_of(plan, cells, records, folder)
    assert text.count("There are no pictures of its bundle") == 2 and "it was changed since" in text
    assert "data:image" not in text and "refined" in text


def test_what_a_page_may_not_hold_are_the_best_views_of_each_cell(done):
    _, cells, records, _ = done
    shown = shown_cells([(cell, records[cell.folder]) for cell in cells])
    whole, uris = within_bound(shown)
    assert [one.left_out for one in whole] == [0, 0] and len(uris) == 2 * 2 * 5
    files = [[view.truth, view.unseen, *(one.picture for one in view.renderings)] for view in whole[0].frozen]
    of_view = [sum(len(uris[file]) for file in own) for own in files]
    for bound, left_out in ((of_view[0] - 1, [2, 2]), (of_view[0] + 1, [1, 2]), (3 * max(of_view), [0, 1])):
        cut, held = within_bound(shown, bound)
        assert [one.left_out for one in cut] == left_out and sum(map(len, held.values())) <= bound
        for one in cut:
            assert one.pictured == one.frozen[: 2 - one.left_out]
            assert not one.pictured or one.pictured[0].name == NAMES[1]


def test_names_cannot_become_html(done):
    plan, cells, records, folder = done
    nasty = '<script>alert("x")</script>'
    record = records[cells[0].folder]
    odd = Record(record.key, record.arms, record.assets, record.stages, {nasty: 1.0}, {"version": nasty}, 1.0)
    page = Page(text_of(plan, cells, {**records, cells[0].folder: odd}, folder))
    assert page.scripts == 1 and page.open == [] and page.text.count(nasty) == 2


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere paths are Unicode")
def test_a_folder_that_no_text_can_name_has_a_page_with_its_name_written_out(done, tmp_path):
    plan, cells, records, _ = done
    odd = tmp_path / os.fsdecode(b"room \xff")
    odd.mkdir()
    assert "room \\udcff" in text_of(plan, cells, records, odd)


def test_no_two_curves_are_one_file(done, tmp_path):
    plan, cells, records, folder = done
    names = [("a", "b-c"), ("a-b", "c"), ("a", "all_scenes")]
    moved, those = [], {}
    for preset, scene in names:
        for cell in cells:
            one = replace(
                cell,
                preset=replace(cell.preset, name=preset),
                scene=replace(cell.scene, name=scene),
                folder=folder / "cells" / preset / scene / f"{cell.captures}" / f"seed_{cell.seed}",
            )
            moved.append(one)
            those[one.folder] = records[cell.folder]
    scenes = tuple(replace(plan.scenes[0], name=scene) for scene in ("b-c", "c", "all_scenes"))
    gather(replace(plan, scenes=scenes), moved, those, folder)
    titles = {file.read_text().partition("<title>")[2].partition(":")[0] for file in (folder / "figures").iterdir()}
    assert titles == {"b-c, a", "c, a-b", "all_scenes, a", "all scenes, a"}
