"""Names that are folders' and files' on any system."""

from __future__ import annotations

import re


def plain_name(name: str) -> str:
    """A name that is a file's on any system."""
    return re.sub(r"[^A-Za-z0-9._-]", "_", name).strip("._") or "object"
