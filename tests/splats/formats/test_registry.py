"""The registry of formats: found, not listed by hand, and no two of them alike."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.formats.registry import FORMATS, MENU, SUFFIXES, format_of


def test_every_suffix_is_one_formats_and_the_menu_has_them() -> None:
    assert len(set(SUFFIXES)) == len(SUFFIXES)
    assert {suffix for suffix, _, _ in MENU} == set(SUFFIXES) - {".usd"}  # the same file as .usdc
    assert MENU[0][0] == ".ply"
    assert len({found.rank for found in FORMATS}) == len(FORMATS)
    for found in FORMATS:
        assert all(format_of(Path(f"ROOM{suffix.upper()}")) is found for suffix in found.suffixes)
    with pytest.raises(AssetError, match="no format of splats"):
        format_of("room.obj")


def test_a_file_with_a_format_is_all_that_another_one_needs(tmp_path: Path) -> None:
    (tmp_path / "points.py").write_text(
        "from r2sego_blender.splats.formats.record import SplatFormat\n"
        "FORMAT = SplatFormat(('.points',), (('.points', 'Points', 'Centres'),), 9, (b'PNT',), None, None)\n"
    )
    program = (
        "from r2sego_blender.splats import formats\n"
        f"formats.__path__.append({str(tmp_path)!r})\n"
        "from r2sego_blender.splats.formats.registry import MENU, SUFFIXES\n"
        "print(SUFFIXES[-1], MENU[-1][1])\n"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=Path(__file__).parents[3], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [".points", "Points"]
