"""Measure the tab with a large bundle, inside Blender's window.

blender --enable-event-simulate --python measured.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import hand  # found beside this file
import press  # its install()

SHOW = ("import_captures", "show_proxy", "show_candidates", "show_asset", "show_rollout")
PLAY_S = 6.0


def resident_mb():
    """Memory of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS"))


def played():
    """Play the timeline, every frame drawn: frames and processor milliseconds a frame."""
    frames = []
    bpy.context.scene.sync_mode = "NONE"
    bpy.context.scene.render.fps = 240
    count = lambda *_: frames.append(time.perf_counter())  # noqa: E731
    area, _ = hand.view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    override = {"window": hand.window(), "area": area, "region": region}
    with bpy.context.temp_override(**override):
        bpy.ops.screen.animation_play()
    yield 1.0
    bpy.app.handlers.frame_change_post.append(count)
    started_s, cpu_s = time.perf_counter(), time.process_time()
    yield PLAY_S
    elapsed_s, cpu_s = time.perf_counter() - started_s, time.process_time() - cpu_s
    bpy.app.handlers.frame_change_post.remove(count)
    with bpy.context.temp_override(**override):
        bpy.ops.screen.animation_cancel()
    yield 0.5
    return {"frames_per_s": len(frames) / elapsed_s, "cpu_ms": 1e3 * cpu_s / max(1, len(frames))}


def drawn_ms():
    """Draw the side bar again and again: milliseconds in the panels' draw, all together."""
    spent = []
    for cls in hand.panels():
        cls.draw = timed(cls.draw, spent)
    redraws = 20
    for _ in range(redraws):
        _, bar = hand.view()
        bar.tag_redraw()
        yield 0.3
    return 1e3 * sum(spent) / redraws


def timed(draw, spent):
    """The panel's draw, its time noted."""

    def noting(panel, context):
        started_s = time.perf_counter()
        draw(panel, context)
        spent.append(time.perf_counter() - started_s)

    return noting


def script():
    """An empty Blender first, then everything shown."""
    yield 1.0
    told = {"empty": (yield from played()), "empty_mb": resident_mb()}
    press.install()
    yield from hand.open_tab()
    told["shown"] = []
    for name in SHOW:
        if hasattr(bpy.types, f"R2SEGO_OT_{name}"):
            try:
                getattr(bpy.ops.r2sego, name)()
                told["shown"].append(name)
            except RuntimeError as error:
                told[f"{name} refused"] = str(error)
    yield 2.0
    told["full"] = yield from played()
    told["panels_draw_ms"] = yield from drawn_ms()
    yield from hand.picture("picture")
    told["full_mb"] = resident_mb()
    (hand.OUT / "told.json").write_text(json.dumps(told, indent=1))


hand.perform(script())
