"""docs/settings.md says what the settings are."""

from pathlib import Path

from tools.pages.settings import settings_page

PAGE = Path(__file__).parents[3] / "docs" / "settings.md"


def test_the_page_is_made_from_the_settings():
    assert PAGE.read_text(encoding="utf-8") == settings_page(), "run `python -m tools.pages.settings`"
