"""Measure the panels' draw with a large bundle, every panel open, inside Blender's window.

blender --enable-event-simulate --python measured_panels.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drawn_buttons  # found beside this file
import hand
import press  # its install() and SHOW


def drawn_ms():
    """Draw the side bar again and again: the panels' draw, all together, in processor milliseconds."""
    spent = []
    for cls in drawn_buttons.panels():
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
        started_s = time.thread_time()
        draw(panel, context)
        spent.append(time.thread_time() - started_s)

    return noting


def script():
    """Everything is in the bundle, so every panel has all its facts to tell."""
    yield 1.0
    press.install()
    yield from hand.open_tab()
    for name in press.SHOW:
        getattr(bpy.ops.r2sego, name)()
    yield 2.0
    told = {"panels_draw_ms": (yield from drawn_ms())}
    yield from hand.picture("every_panel")
    (hand.OUT / "told.json").write_text(json.dumps(told))


hand.perform(script())
