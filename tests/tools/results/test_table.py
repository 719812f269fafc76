"""The command that makes the README's table: rows replaced and kept, scenes it cannot show."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from r2sego_blender.evaluation.arms import DEFAULT_ARMS
from tools.results import table

ROOT = Path(__file__).parents[3]


@pytest.fixture
def readme(tmp_path, monkeypatch):
    """A README of its own, with rows of two scenes."""
    rows = "| room_a | old |\n| desk | old |\n\nA caption.\nMade on 2026-01-02, An old machine, 4 cores."
    text = f"Before\n{table.BEGIN}\n| scene |\n| --- |\n{rows}\n{table.END}\nAfter\n"
    (tmp_path / "README.md").write_text(text, encoding="utf-8")
    monkeypatch.setattr(table, "README", tmp_path / "README.md")
    return tmp_path / "README.md"


@pytest.fixture
def evaluated(tmp_path, monkeypatch):
    """A function that runs the command on scenes of these names, each with scores."""

    def opened(path):
        report, captures = path / "report", path / "captures"
        report.mkdir(parents=True, exist_ok=True)
        captures.mkdir(exist_ok=True)
        arm = {"psnr": 20.0, "ssim": 0.5, "views": [1, 2]}
        arms = dict.fromkeys(DEFAULT_ARMS, arm) | {
            "same_points": {**arm, "psnr": 21.0},
            "refined": {**arm, "psnr": 23.5},
        }
        (report / "metrics.json").write_text(json.dumps({"arms": arms}))
        (captures / "cameras.json").write_text(json.dumps({"captures": [{}] * 6}))
        declared = SimpleNamespace(overrides={"rounds": 1}, preset="preview")
        return SimpleNamespace(
            path=path,
            declaration=declared,
            metrics_file=report / "metrics.json",
            read=lambda artifact: artifact.load(path / artifact.name),
        )

    def run_it(*names, options=()):
        scenes = [str(tmp_path / f"{name}.r2s") for name in names]
        monkeypatch.setattr(table, "Scene", SimpleNamespace(open=opened))
        monkeypatch.setattr(sys, "argv", ["table.py", *scenes, *options])
        table.main()

    return run_it


def run(*arguments):
    readme = (ROOT / "README.md").read_bytes()
    command = [sys.executable, "-m", "tools.results.table", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (ROOT / "README.md").read_bytes() == readme
    return done


def test_help_says_what_it_takes():
    done = run("--help")
    assert done.returncode == 0
    assert "r2sego evaluate" in done.stdout


@pytest.mark.parametrize("made", [False, True])
def test_a_scene_without_scores_is_named(tmp_path, made):
    scene = tmp_path / "room.r2s"
    if made:
        subprocess.run(
            [
                sys.executable,
                "-m",
                "r2sego_blender",
                "new",
                scene,
                "--captures",
                ROOT / "demo/room/captures",
                "--poses",
                ROOT / "demo/room/cameras.json",
            ],
            cwd=ROOT,
            check=True,
            capture_output=True,
        )
    done = run(scene)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert f"{scene}" in done.stderr
    assert ("not all scored yet" if made else "there is no such folder") in done.stderr


def test_the_table_is_printed_and_nothing_written(readme, evaluated, capsys):
    before = readme.read_bytes()
    evaluated("room_a")
    assert readme.read_bytes() == before
    printed = capsys.readouterr().out
    assert "| room_a | 6 | 2 | 20.00 / 0.500 |" in printed and "| `--preset preview --set rounds=1` |" in printed
    assert "| desk | old |" in printed and "Before" not in printed


def test_named_rows_are_replaced_and_the_others_keep_their_place_and_date(readme, evaluated):
    evaluated("hall", "room_a", options=["--write"])
    text = readme.read_text(encoding="utf-8")
    assert text.startswith(f"Before\n{table.BEGIN}\n| scene | captures |")
    assert text.endswith(f"\n{table.END}\nAfter\n")
    assert re.findall(r"^\| (\w+) \| (?:6|old) ", text, re.MULTILINE) == ["room_a", "desk", "hall"]
    assert "| desk | old |" in text and "room_a | old" not in text
    assert re.search(r"^Made on [^:\n]* cores: room_a, hall\.$", text, re.MULTILINE)
    assert "\nMade on 2026-01-02, An old machine, 4 cores: desk.\n" in text
    evaluated("desk", options=["--write"])
    again = readme.read_text(encoding="utf-8")
    assert len(re.findall(r"^Made on [^:\n]* cores\.$", again, re.MULTILINE)) == 1 and "old" not in again
    evaluated("desk", "hall", "room_a", options=["--write"])
    assert readme.read_text(encoding="utf-8") == again


def test_a_readme_without_the_markers_is_left_alone(readme, evaluated, capsys):
    readme.write_text("Only words\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        evaluated("room_a", options=["--write"])
    assert readme.read_text(encoding="utf-8") == "Only words\n"
    assert table.END in capsys.readouterr().err
