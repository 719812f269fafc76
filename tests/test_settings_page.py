"""docs/settings.md says what the settings are."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_is_made_from_the_settings():
    spec = importlib.util.spec_from_file_location("make_settings", DOCS / "make_settings.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (DOCS / "settings.md").read_text(encoding="utf-8")
    assert page == module.settings_page(), "run `python docs/make_settings.py`"
