"""A stand-in for the engine's Python: answers ``-m r2sego_blender COMMAND …`` from a script.

The conduct is the file beside this one's link, ``conduct.txt``; each call is noted in
``calls.jsonl``.
"""

import json
import sys
import time
from pathlib import Path

HERE = Path(sys.argv[0]).parent
ARGUMENTS = sys.argv[3:]


def tell(**event):
    print(json.dumps(event), flush=True)


def main() -> int:
    with (HERE / "calls.jsonl").open("a") as file:
        file.write(json.dumps(ARGUMENTS) + "\n")
    conduct = (HERE / "conduct.txt").read_text().strip()
    if ARGUMENTS[:2] == ["doctor", "--backends"]:
        usable = {"label": "A Model", "why": "", "weights_licence": "MIT"}
        missing = {"label": "Another", "why": "Another is not set up", "weights_licence": "CC BY-NC 4.0"}
        print(json.dumps({"backends": [usable, missing]}))
        return 0
    if ARGUMENTS[0] == "doctor":
        packages = [{"name": "torch", "version": "9.9", "required": True}]
        found = {"python": "3.99", "r2sego": "0.1.0", "packages": packages, "ready": True}
        print(json.dumps(found, indent=1))
        return 0
    tell(event="progress", task="Dense stereo", done=1, total=4, elapsed_s=1.0, remaining_s=3.0)
    if conduct == "live":
        for line in (HERE / "live.jsonl").read_text().splitlines():
            tell(event="live", **json.loads(line))
        time.sleep(300)
    if conduct == "lack":
        raise ModuleNotFoundError("No module named 'click'")
    if conduct == "sleep":
        time.sleep(300)
    if conduct == "slow":
        time.sleep(0.5)
    if conduct == "fail":
        tell(event="error", kind="CaptureError", text="images/a.png: it is empty. Replace the file.")
        return 1
    tell(event="message", level="info", text="Round 1 of 2")
    tell(event="progress", task="Dense stereo", done=4, total=4, elapsed_s=4.0, remaining_s=0.0)
    tell(event="result", asset="asset.ply", scale="metric poses")
    return 0


if __name__ == "__main__":
    sys.exit(main())
