"""Measure the tab with a large bundle, inside Blender's window, before and after Simplify Viewport.

The empty scene is Blender's first, its cube selected as it comes; the tab stands open beside it too, its
panels as they come.

blender --enable-event-simulate --python measured.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import statistics
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import hand  # found beside this file
import press  # its install() and SHOW

ROUNDS = 3
MEASURED_S = 6.0
_FAST = 240  # frames a second that nothing reaches
_RULER_PX = 10  # from the timeline's upper edge, where frames are picked
_STEP_PX = 15


def resident_mb():
    """Memory of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS"))


def region_of(kind):
    """The largest area of this kind and its main region."""
    areas = [area for area in hand.window().screen.areas if area.type == kind]
    area = max(areas, key=lambda a: a.width * a.height)
    return area, next(region for region in area.regions if region.type == "WINDOW")


def drawn_frames(acting):
    """Count the frames while the generator ``acting`` goes on: frames a second, and ms a frame.

    ``cpu_ms`` is of all threads, ``main_thread_ms`` of the one that no other can help.
    """
    frames = []
    count = lambda *_: frames.append(1)  # noqa: E731
    bpy.app.handlers.frame_change_post.append(count)
    clocks = (time.perf_counter, time.process_time, time.thread_time)
    started_s = [clock() for clock in clocks]
    yield from acting
    elapsed_s, *spent_s = (clock() - start for clock, start in zip(clocks, started_s, strict=True))
    bpy.app.handlers.frame_change_post.remove(count)
    cpu_ms, main_thread_ms = (1e3 * s / max(1, len(frames)) for s in spent_s)
    return {"frames_per_s": len(frames) / elapsed_s, "cpu_ms": cpu_ms, "main_thread_ms": main_thread_ms}


def waiting():
    """Nothing, as long as is measured."""
    yield MEASURED_S


def played():
    """Play the timeline, every frame drawn."""
    scene = hand.window().scene
    scene.sync_mode, scene.render.fps, scene.render.fps_base = "NONE", _FAST, 1.0
    area, region = region_of("VIEW_3D")
    override = {"window": hand.window(), "area": area, "region": region}
    with bpy.context.temp_override(**override):
        bpy.ops.screen.animation_play()
    yield 1.0
    told = yield from drawn_frames(waiting())
    with bpy.context.temp_override(**override):
        bpy.ops.screen.animation_cancel()
    yield 0.5
    return told


def scrubbed():
    """Drag along the timeline with the mouse, back and forth."""
    _, region = region_of("DOPESHEET_EDITOR")
    y = region.y + region.height - _RULER_PX
    left, right = region.x + region.width // 5, region.x + 4 * region.width // 5
    yield from hand.move(left, y)
    hand.window().event_simulate("LEFTMOUSE", "PRESS", x=left, y=y)
    yield 0.5
    assert hand.window().screen.is_scrubbing, "the mouse does not scrub"
    told = yield from drawn_frames(dragging(left, right, y))
    hand.window().event_simulate("LEFTMOUSE", "RELEASE", x=left, y=y)
    yield 0.5
    return told


def dragging(left, right, y):
    """One step of the mouse each time Blender has drawn."""
    until_s, x, step = time.perf_counter() + MEASURED_S, left, _STEP_PX
    while time.perf_counter() < until_s:
        if not left <= x + step <= right:
            step = -step
        x += step
        hand.window().event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        yield 0.0


def compared(scenes):
    """Play and scrub each scene by turns; the medians, and how much of a frame ours takes."""
    told = {"played": {}, "scrubbed": {}}
    for _ in range(ROUNDS):
        for name, scene in scenes.items():
            hand.window().scene = scene
            yield 1.0
            for way, measure in (("played", played), ("scrubbed", scrubbed)):
                told[way].setdefault(name, []).append((yield from measure()))
    for way in told.values():
        for name, runs in way.items():
            way[name] = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
        way["full_to_empty"] = {key: way["full"][key] / way["empty"][key] for key in way["empty"]}
    return told


def script():
    """Everything is shown in a scene of its own; Blender's first scene stays as empty as it is."""
    yield 1.0
    told = {"empty_mb": resident_mb(), "shown": []}
    empty = hand.window().scene
    with bpy.context.temp_override(window=hand.window()):
        bpy.ops.scene.new(type="LINK_COPY")
    yield 0.5
    press.install(every_panel=False)
    yield from hand.open_tab()
    for name in press.SHOW:
        try:
            getattr(bpy.ops.r2sego, name)()
            told["shown"].append(name)
        except RuntimeError as error:
            told[f"{name} refused"] = str(error)
    bpy.context.scene.r2sego_views.curves = True
    yield 2.0
    yield from hand.picture("picture")
    scenes = {"empty": empty, "full": hand.window().scene}
    told["as it comes"] = yield from compared(scenes)
    told["full_mb"] = resident_mb()
    bpy.ops.r2sego.simplify_viewport()
    yield 2.0
    told["drawn faster"] = yield from compared(scenes)
    yield from hand.picture("drawn_faster")
    (hand.OUT / "told.json").write_text(json.dumps(told, indent=1))


hand.perform(script())
