"""``r2sego views``: told and decided by hand."""

import json
import subprocess
import sys

import pytest
from bundles import new_bundle
from click.testing import CliRunner

from r2sego_blender.commands.cli import main


@pytest.fixture
def room(tmp_path):
    """A bundle with one round of two views, the second of which the gate rejected."""

    def fill(folder):
        for rank, accepted in enumerate((True, False)):
            view = folder / "rounds" / "0" / "views" / f"{rank:03d}"
            view.mkdir(parents=True)
            record = {
                "accepted": accepted,
                "reason": "registered: 9 of 10 patches agree",
                "rank": rank,
                "generator": "blending",
                "candidate": 3,
                "rollout": 1,
                "frame": 4,
                "reference": 0,
                "reference_name": "a.png",
                "overlap": 0.5,
                "query": {},
                "estimate": None if rank else {},
            }
            (view / "pose.json").write_text(json.dumps(record))

    return new_bundle(tmp_path / "room.r2s", fill, overrides={"selection.target_views": 2}).path


def r2sego(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_views_are_listed(room):
    said = r2sego("views", room)
    assert said.exit_code == 0, said.output
    assert "1 of 2 views are trained on" in said.output
    told = json.loads(r2sego("views", room, "--json").output)
    assert [view["accepted"] for view in told["views"]] == [True, False]


def test_what_the_round_made_of_a_view_stands_beside_it(room):
    """As its counts tell it, and only where they do; what is damaged is a sentence."""
    assert [view["effect"] for view in json.loads(r2sego("views", room, "--json").output)["views"]] == [None, None]
    effect = {"rank": 0, "new": 0.25, "psnr_before": 12.25, "psnr_after": None}
    counts = room / "rounds" / "0" / "metrics.json"
    counts.write_text(json.dumps({"views": [effect]}))
    assert [view["effect"] for view in json.loads(r2sego("views", room, "--json").output)["views"]] == [effect, None]
    told = r2sego("views", room).output
    assert "25%" in told and "12.2" in told
    counts.write_text(json.dumps({"views": [{**effect, "new": "all"}]}))
    said = r2sego("views", room)
    assert said.exit_code == 1 and "metrics.json" in said.output


def test_views_are_decided_on_by_hand(room):
    assert r2sego("views", room, "--round", 0, "--reject", 0).exit_code == 0
    assert json.loads((room / "rounds/0/views/000/decision.json").read_text())["accepted"] is False
    command = [sys.executable, "-m", "r2sego_blender", "views", room, "--undecided", "0", "--json-progress"]
    said = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    result = json.loads(said.stdout.splitlines()[-1])
    assert result["event"] == "result" and result["accepted"] == 1
    assert not (room / "rounds/0/views/000/decision.json").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--accept", "1"], "no estimated pose"),
        (["--reject", "5"], "no generated view 5"),
        (["--accept", "0", "--reject", "0"], "decided on twice"),
        (["--round", "3"], "no generated views"),
    ],
)
def test_what_cannot_be_is_refused(room, arguments, said):
    done = r2sego("views", room, *arguments)
    assert done.exit_code == 1
    assert said in done.output
    assert not list(room.rglob("decision.json"))


def test_a_decision_that_cannot_be_told_is_not_taken(room):
    """Another view is damaged: the command fails, so it has changed nothing."""
    pose = room / "rounds/0/views/001/pose.json"
    record = json.loads(pose.read_text())
    del record["reference_name"]
    pose.write_text(json.dumps(record))
    said = r2sego("views", room, "--round", 0, "--reject", 0)
    assert said.exit_code == 1 and "001/pose.json" in said.stderr
    assert not (room / "rounds/0/views/000/decision.json").exists()
