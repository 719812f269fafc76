"""Programs that are Python bodies, for tests that need something to run in another's place."""

import io
import os
import sys
import zipfile
from importlib import resources
from pathlib import Path

import pytest


def write_program(place: Path, body: str, options: str = "") -> Path:
    """Write an executable that runs ``body`` by this Python; returns it: ``place``, on Windows an .exe."""
    first_line = f'#!"{sys.executable}"' if os.name == "nt" else f"#!{sys.executable}"
    first_line = f"{first_line} {options}".rstrip()
    if os.name != "nt":
        place.write_text(f"{first_line}\n{body}\n", encoding="utf-8")
        place.chmod(0o755)
        return place
    pytest.importorskip("pip", reason="its launchers make programs of scripts")
    launcher = resources.files("pip._vendor.distlib").joinpath("t64.exe").read_bytes()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as script:
        script.writestr("__main__.py", body)
    place = place.with_name(f"{place.name}.exe")
    place.write_bytes(launcher + first_line.encode() + b"\r\n" + archive.getvalue())
    return place
