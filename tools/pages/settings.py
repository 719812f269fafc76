"""Write docs/settings.md from the settings' own docs: ``python -m tools.pages.settings``."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from r2sego_blender.config.presets import PRESETS, entries
from r2sego_blender.config.settings import Settings


def _only_how() -> str:
    return " and ".join(f"`{entry.key}`" for entry in entries() if not entry.changes_result)


def settings_page() -> str:
    """The page's Markdown."""
    lines = [
        "# Settings",
        "",
        "Made by `python -m tools.pages.settings` from `r2sego_blender/config/`; do not edit.",
        "Give any of them as `r2sego refine SCENE --set key=value`: the scene keeps it, until another",
        "preset is asked for. Those of captures are for `r2sego new`, where photographs become captures, and stay.",
        "The defaults are the paper's (its H) or, where the paper is silent, what measured best. The last",
        "column is the `preview` preset. Where one is changed, the next run makes again what depends on it,",
        f"but for {_only_how()}, which change no result.",
    ]
    docs = {f.name: type(getattr(Settings(), f.name)).__doc__ for f in dataclasses.fields(Settings)}
    section = None
    for entry in entries():
        name = entry.key.rpartition(".")[0]
        if name != section:
            section = name
            title, doc = (section.capitalize(), docs[section]) if section else ("Whole run", Settings.__doc__)
            lines += ["", f"## {title}", "", (doc or "").strip().splitlines()[0], ""]
            lines += ["| key | default | range | meaning | preview |", "| --- | --- | --- | --- | --- |"]
        allowed = ", ".join(entry.choices) if entry.low is None else f"{entry.low:g} to {entry.high:g}"
        preview = PRESETS["preview"].get(entry.key, "")
        lines.append(f"| `{entry.key}` | {entry.default} | {allowed} | {entry.doc} | {preview} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    (Path(__file__).parents[2] / "docs" / "settings.md").write_text(settings_page(), encoding="utf-8")
