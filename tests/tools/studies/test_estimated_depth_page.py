"""The study's tables and figure: every point in its row, seeds averaged, and the page around them left alone."""

import xml.etree.ElementTree as ET

import pytest

from tools.studies.estimated_depth import NONE, Point, points
from tools.studies.estimated_depth_page import BEGIN, END, FIGURE, PAGE, figure, tables, write_page


def _shares(value: float) -> dict[str, float]:
    return {"within_5_percent": value, "within_10_percent": value + 0.01}


def _point(kind: str, error: float = 0.0, seed: int = 0, right: float = 0.9, psnr: float | None = None) -> dict:
    one = {"scene": "room", "kind": kind, "error": error, "seed": seed, "made": "today, a machine"}
    one |= {"completed": _shares(right), "proxy": {"fscore": 0.8, "precision": 0.7, "recall": 0.9}}
    if kind != NONE:
        one["given"] = {"absrel": error, **_shares(0.5)}
        one["estimate"] = {**_shares(0.6), "unseen": {"within_1": 0.68, "within_2": 0.95, "within_3": 0.99}}
        one["best"] = _shares(0.97)
    if psnr is not None:
        one["views"] = {"psnr": psnr, "ssim": 0.8}
    return one


SOME = [
    _point(NONE, psnr=25.0),
    _point("all", 0.05, 0, right=0.90, psnr=26.0),
    _point("all", 0.05, 1, right=0.94),
    _point("smooth", 0.05),
    _point("all", 0.2, right=0.7),
]


def test_a_row_a_kind_and_error_with_the_means_over_seeds():
    rows = [line for line in tables(SOME).splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
    assert [row[0] for row in cells] == ["none", "all, 5%", "all, 20%", "smooth, 5%"]
    assert [row[3] for row in cells] == ["90.0 (91.0)", "92.0 (93.0)", "70.0 (71.0)", "90.0 (91.0)"]
    assert [row[4] for row in cells] == ["", *["97.0 (98.0)"] * 3]
    assert cells[0][1:3] == ["", ""] and cells[0][-1] == "25.00 / 0.800"
    assert cells[1][6:] == ["68, 95, 99", "26.00 / 0.800"] and cells[2][-1] == ""


def test_a_room_that_is_refused_without_an_estimate_is_told_so():
    refused = {"scene": "room", "kind": NONE, "error": 0.0, "seed": 0, "made": "today", "refused": "no depth"}
    assert tables([refused]).splitlines()[-1] == "| none |  |  | refused |  |  |  |  |"
    assert ET.fromstring(figure([refused, _point("all", 0.05)])).tag.endswith("svg")


def test_the_figure_is_sound_and_shows_every_point():
    root = ET.fromstring(figure([*SOME, {**_point("flat", 0.1), "scene": "a <b> & c"}]))
    name = "{http://www.w3.org/2000/svg}"
    dots = root.findall(f".//{name}circle")
    assert len(dots) == 2 * 3 + 1 + 2  # completed and F-score of three, PSNR of one; the other scene's two
    width, height = (float(value) for value in root.get("viewBox").split()[2:])
    assert all(0 <= float(dot.get("cx")) <= width and 0 <= float(dot.get("cy")) <= height for dot in dots)


def test_the_page_around_the_tables_stays(tmp_path):
    (tmp_path / FIGURE.parent).mkdir()
    page = tmp_path / PAGE
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    for _ in range(2):
        write_page(SOME, tmp_path)
        text = page.read_text(encoding="utf-8")
        assert text.startswith(f"before\n{BEGIN}") and text.endswith(f"{END}\nafter\n") and "old" not in text
        assert tables(SOME) in text
    page.write_text("no place\n", encoding="utf-8")
    with pytest.raises(ValueError):
        write_page(SOME, tmp_path)


def test_points_begin_without_an_estimate_and_hold_one_without_error():
    found = points(("smooth", "all"), (0.0, 0.05), seeds=2)
    assert found[0] == Point(NONE)
    assert len(found) == len(set(found)) == len({one.name for one in found}) == 1 + 2 + 1 + 2
    assert [one for one in found if one.error == 0.0] == [Point(NONE), Point("all")]
