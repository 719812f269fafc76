"""A page on this machine, opened in the web browser."""

import sys
from pathlib import Path

import bpy


def open_page(page: Path) -> None:
    """Open a page; without a window nothing is opened."""
    if bpy.app.background:
        return
    if sys.platform == "win32":  # where a URL's %C3%BC need not be read as the letter it stands for
        bpy.ops.wm.path_open(filepath=str(page))
    else:
        bpy.ops.wm.url_open(url=page.as_uri())
