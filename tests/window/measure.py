"""Measure the tab in a real Blender: ``BLENDER=/path/to/blender python tests/window/measure.py OUT``.

Prints time of the panels' draw, frames a second and processor milliseconds a frame while the
timeline plays and while it is scrubbed with the mouse, an empty scene and the full one by turns in
the same run, as Blender comes and after Simplify Viewport, and memory above an empty Blender.
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "fakes")]
import display  # noqa: E402  # found beside this file
from large_bundle import write_large_bundle  # noqa: E402
from stand_in_engine import write_stand_in_engine  # noqa: E402


def main() -> None:
    """The command line."""
    if display.missing():
        raise SystemExit(display.missing())
    out = Path(sys.argv[1]).absolute()
    out.mkdir(parents=True)
    package, engine = display.build_zip(out), write_stand_in_engine(out)
    bundle = write_large_bundle(out / "room.r2s")
    told = {}
    for name in ("measured", "measured_panels"):
        folder = out / name
        log = display.run(HERE / f"{name}.py", folder, str(package), str(bundle), str(engine))
        if not (folder / "told.json").is_file():
            raise SystemExit(log)
        told |= json.loads((folder / "told.json").read_text())
    print(json.dumps(told, indent=1))
    for drawn in ("as it comes", "drawn faster"):
        for way in ("played", "scrubbed"):
            frames = told[drawn][way]
            empty, full, share = frames["empty"], frames["full"], frames["full_to_empty"]["cpu_ms"]
            print(
                f"{way}, {drawn}: {full['frames_per_s']:.1f} frames/s, the empty scene"
                f" {empty['frames_per_s']:.1f};"
                f" {full['main_thread_ms']:.0f} ms of a frame in the main thread;"
                f" processor time {share:.2f} times the empty scene's"
            )
    print(f"draw of all panels, every one open: {told['panels_draw_ms']:.1f} ms")
    print(f"memory above an empty Blender: {told['full_mb'] - told['empty_mb']:.0f} MB")
    print(f"zip: {package.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
