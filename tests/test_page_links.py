"""The pages' links lead to files and headings that are there, and no merge left its marks."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "demo").rglob("*.md")]
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")


def _anchors(page: Path) -> set[str]:
    """The names that GitHub gives a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def test_every_link_leads_somewhere():
    broken, looked_at = [], 0
    for page in PAGES:
        for place, anchor in LINK.findall(page.read_text(encoding="utf-8")):
            target = page.parent / place if place else page
            looked_at += 1
            if not target.exists() or (anchor and anchor not in _anchors(target)):
                broken.append(f"{page.relative_to(ROOT)}: {place}#{anchor}")
    assert looked_at > 50 and not broken, broken


def test_no_page_has_two_versions_of_a_line():
    marks = re.compile(r"^(<{7}|={7}$|>{7})", flags=re.MULTILINE)
    assert [page.name for page in PAGES if marks.search(page.read_text(encoding="utf-8"))] == []
