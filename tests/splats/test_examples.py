"""The Python in the documents on splats runs as it is written."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from splat_reference import random_asset

from r2sego_blender.splats.formats.registry import load_asset, save_asset

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("page", ["splats.md", "splat_formats.md"])
def test_examples_run_as_they_are_written(page, tmp_path, monkeypatch):
    save_asset(tmp_path / "room.ply", random_asset(np.random.default_rng(0)))
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)
    found: dict = {}
    exec(compile(example, page, "exec"), found)
    if page == "splats.md":
        assert found["image"].shape == (480, 640, 3)
        assert all(parameter.grad.shape == parameter.shape for parameter in found["parameters"])
    else:
        assert len(load_asset("room.spz")) == len(load_asset("room.ply"))
