"""Measure the tab in a real Blender: ``BLENDER=/path/to/blender python tests/window/measure.py OUT``.

Prints what stands in docs/blender.md: time of the panels' draw, frames a second while the
timeline plays (an empty Blender beside it, in the same run), and memory above an empty Blender.
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[0] / "bridge")]
import display  # noqa: E402  # found beside this file
from large_bundle import write_large_bundle  # noqa: E402


def main() -> None:
    """The command line."""
    if display.missing():
        raise SystemExit(display.missing())
    out = Path(sys.argv[1]).absolute()
    out.mkdir(parents=True)
    package, engine = display.build_zip(out), display.stand_in_engine(out)
    bundle = write_large_bundle(out / "room.r2s")
    log = display.run(HERE / "measured.py", out / "run", str(package), str(bundle), str(engine))
    if not (out / "run" / "told.json").is_file():
        raise SystemExit(log)
    told = json.loads((out / "run" / "told.json").read_text())
    print(json.dumps(told, indent=1))
    print(f"memory above an empty Blender: {told['full_mb'] - told['empty_mb']:.0f} MB")
    print(f"zip: {package.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
