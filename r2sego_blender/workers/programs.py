"""Programs as a person names them. Standard library alone."""

from __future__ import annotations

import os
import shutil
from pathlib import Path


def find_program(word: str) -> str | None:
    """Where a program is that is named by its path, or by its name among those of ``PATH``; None where it is not.

    By its name it is none in the folder the person stands in, where Windows looks first: that may be a bundle.
    """
    found = shutil.which(word)
    by_path = os.path.dirname(word)  # noqa: PTH120  (for Path "./tool" is "tool")
    if found is None or by_path or Path(found).is_absolute():
        return found
    return None
