"""Picks and measures come back from their file, and damaged files are refused."""

from __future__ import annotations

import json

import pytest
from expected_errors import refused

from r2sego_blender.captures.frame.picks import CameraHeight, Pick, PickedLength, PickedPoint, Picks
from r2sego_blender.core.errors import CaptureError

PICKS = Picks(
    (
        PickedPoint("A", (Pick("p0", 12.25, 40.5), Pick("p2", 80.0, 3.125)), floor=True),
        PickedPoint("shelf", (Pick("p1", 7.0, 9.0),)),
    ),
    (PickedLength("A", "shelf", 1.75),),
    (CameraHeight("p0", 1.5),),
)


def test_picks_come_back_from_json():
    assert Picks.from_json(json.loads(json.dumps(PICKS.to_json()))) == PICKS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": [{"name": "A"}]}, "views"),
        ({"points": [{"name": "A", "views": []}]}, "picked nowhere"),
        ({"points": [{"name": "A", "views": [{"capture": "p0", "x_px": "x", "y_px": 1}]}]}, "wrong"),
        ({"points": [{"name": "A", "views": 2 * [{"capture": "p0", "x_px": 1, "y_px": 1}]}]}, "twice in one"),
        ({"points": 2 * [{"name": "A", "views": [{"capture": "p0", "x_px": 1, "y_px": 1}]}]}, "two points"),
        ({"points": [{"name": "A", "floor": "false", "views": [{"capture": "p0", "x_px": 1, "y_px": 1}]}]}, "'floor'"),
        ({"lengths": [{"from": "A", "to": "B", "metres": 1}]}, "from 'A' to 'B'"),
        ({"camera_heights": [{"capture": "p0", "metres": -1}]}, "no length"),
        ({"camera_heights": [{"capture": "p0", "metres": float("nan")}]}, "NaN"),
        ([], "wrong"),
    ],
)
def test_damaged_picks_are_refused_with_their_file(tmp_path, change, message):
    file = tmp_path / "picks.json"
    file.write_text(json.dumps(change))
    with pytest.raises(CaptureError, match=message) as refused:
        Picks.load(file)
    assert "picks.json" in str(refused.value)


@pytest.mark.parametrize("text", [None, "{", b"\xff"])
def test_what_is_no_picks_file_is_refused(tmp_path, text):
    file = tmp_path / "picks.json"
    if text is not None:
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with refused(CaptureError, "picks.json"):
        Picks.load(file)
