"""Refine for so many seconds and no longer: the job is cancelled then, and finished steps are kept.

blender --background --python batch/examples/engine_cancel.py -- SCENE --after 3600
python batch/examples/engine_cancel.py -- SCENE --after 3600  (pip bpy)

Ctrl-C cancels too. Started again, it goes on where it stopped.
"""

import _thread
import argparse
import signal
import sys
import threading
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))

from enabled_addon import enabled_addon

from r2sego_blender.commands.scripts import run_script


def main(arguments: list[str]) -> int:
    """Refine, cancel when the time is up, and tell; returns 0 when refined, 3 when cancelled."""
    parser = argparse.ArgumentParser(prog="engine_cancel.py", description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--after", type=float, required=True, metavar="SECONDS")
    options = parser.parse_args(arguments)
    with enabled_addon():
        bpy.ops.r2sego.open_scene(directory=str(options.scene.absolute()))
        # An operator waits for its job without a window; a signal's handler runs meanwhile,
        # in the same thread, as Blender's operators need it.
        before = signal.signal(signal.SIGINT, cancel)
        timer = threading.Timer(options.after, _thread.interrupt_main)
        timer.start()
        started_s = time.monotonic()
        try:
            ended = bpy.ops.r2sego.refine()
        finally:
            timer.cancel()
            if before is not None:  # Blender's own, which Python cannot give back
                signal.signal(signal.SIGINT, before)
        print(f"{', '.join(ended).lower()} after {time.monotonic() - started_s:.1f} s")
        for job in bpy.context.window_manager.r2sego_engine.ended:
            print(f"{job.title}: {job.line}")
        state = bpy.context.scene.r2sego
        print(f"{state.rounds_done} of {state.rounds_declared} rounds are done")
    return 0 if ended == {"FINISHED"} else 3


def cancel(*_signal) -> None:
    """Press Cancel, where a job runs."""
    if bpy.ops.r2sego.cancel.poll():
        bpy.ops.r2sego.cancel()


if __name__ == "__main__":
    run_script(main)
