"""A few of the demo room's frozen views: what is done to one is done to sixteen."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from tools.benchmarks.kills import ROOM


def write_first_views(folder: Path, count: int) -> Path:
    """The file in ``folder`` of the demo's first ``count`` frozen views, whose photographs are beside it."""
    told = json.loads((ROOM / "cameras.json").read_text())
    few = told["frozen"][:count]
    for view in few:
        (folder / view["file"]).parent.mkdir(exist_ok=True)
        shutil.copy(ROOM / view["file"], folder / view["file"])
    (folder / "cameras.json").write_text(json.dumps(told | {"frozen": few}))
    return folder / "cameras.json"
