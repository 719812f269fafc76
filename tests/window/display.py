"""A real Blender with its window on a display of its own, and pictures of its screen."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLENDER = os.environ.get("BLENDER", "")
_FIRST_DISPLAY = 120


def missing() -> str:
    """What is not here of what the window tests need; '' when all is."""
    if not BLENDER:
        return "BLENDER does not name a Blender"
    if not shutil.which(BLENDER):
        return f"BLENDER names {BLENDER}, which is not there"
    absent = [name for name in ("Xvfb", "import") if not shutil.which(name)]
    return f"not installed: {', '.join(absent)} (Debian: xvfb, imagemagick)" if absent else ""


def run(script: Path, out: Path, *arguments: str, size=(1400, 900), timeout_s=600.0, blend="") -> str:
    """Run ``script`` in Blender's window until Blender ends; pictures land in ``out``. Returns the log."""
    out.mkdir(parents=True, exist_ok=True)
    width, height = size
    number = next(n for n in range(_FIRST_DISPLAY, 1000) if not Path(f"/tmp/.X11-unix/X{n}").exists())
    display = subprocess.Popen(
        ["Xvfb", f":{number}", "-screen", "0", f"{width}x{height}x24"], stderr=subprocess.DEVNULL
    )
    environment = {
        **os.environ,
        "DISPLAY": f":{number}",
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "TMPDIR": str(out),
        "BLENDER_USER_RESOURCES": str(out.parent / "user"),
    }
    environment.pop("R2SEGO_PYTHON", None)
    log = out / "log.txt"
    try:
        time.sleep(1.0)
        command = [
            BLENDER,
            *([blend] if blend else ["--factory-startup"]),
            "--enable-event-simulate",
            "--window-geometry",
            "0",
            "0",
            str(width),
            str(height),
            "--python",
            str(script),
            "--",
            str(out),
            *arguments,
        ]
        with log.open("w") as stream:
            blender = subprocess.Popen(command, env=environment, cwd=out, stdout=stream, stderr=stream)
        _take_pictures(blender, out, environment, time.monotonic() + timeout_s)
    finally:
        display.kill()
        display.wait()
    return log.read_text(errors="replace")


def _take_pictures(blender, out: Path, environment, until_s: float) -> None:
    while blender.poll() is None:
        for wanted in out.glob("*.wanted"):
            file = wanted.with_suffix(".png")
            subprocess.run(["import", "-window", "root", str(file)], env=environment, check=True)
            wanted.unlink()
        if time.monotonic() > until_s:
            blender.kill()
            blender.wait()
            raise AssertionError(f"Blender did not end: {(out / 'log.txt').read_text()[-2000:]}")
        time.sleep(0.1)


def build_zip(folder: Path) -> Path:
    """Build the extension there."""
    build = ROOT / "batch" / "build_extension.py"
    subprocess.run([sys.executable, str(build), "--out", str(folder)], check=True)
    (package,) = folder.glob("*.zip")
    return package
