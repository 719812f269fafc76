"""docs/architecture.md names files that are there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_every_file_that_the_page_names_is_there():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("|")]
    named = {name for row in rows for name in re.findall(r"`([a-z_]+)`", row)}
    there = {
        file.stem
        for folder in ("r2sego_blender", "operators", "panels")
        for file in (ROOT / folder).rglob("*.py")
    }
    assert len(named) > 100 and named <= there, named - there
