"""Flat shapes and text in the pixels of a region, for overlays. Colours are RGBA in [0, 1]."""

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

_FONT = 0
_SHADOW_LEVEL = 5


def segments(points, colour, width_px: float = 1.5) -> None:
    """Draw (2 N, 2) or (2 N, 3) points as N segments, in pixels or in metres as the overlay is."""
    points = np.asarray(points, np.float32)
    if not len(points):
        return
    padded = points if points.shape[1] == 3 else np.pad(points, ((0, 0), (0, 1)))
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    viewport = gpu.state.viewport_get()
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("viewportSize", viewport[2:])
    shader.uniform_float("lineWidth", width_px)
    shader.uniform_float("color", colour)
    batch_for_shader(shader, "LINES", {"pos": padded}).draw(shader)
    gpu.state.blend_set("NONE")


def rectangle(left: float, bottom: float, width: float, height: float, colour) -> None:
    """Fill a rectangle, in pixels from the region's lower left corner."""
    right, top = left + width, bottom + height
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("color", colour)
    batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)]).draw(shader)
    gpu.state.blend_set("NONE")


def write(text: str, left: float, bottom: float, colour=(1.0, 1.0, 1.0, 1.0), size_px: float = 12.0) -> None:
    """Write a line with a shadow, readable before any picture; in pixels of the region."""
    blf.size(_FONT, size_px)
    blf.enable(_FONT, blf.SHADOW)
    blf.shadow(_FONT, _SHADOW_LEVEL, 0.0, 0.0, 0.0, 0.9)
    blf.color(_FONT, *colour)
    blf.position(_FONT, left, bottom, 0.0)
    blf.draw(_FONT, text)
    blf.disable(_FONT, blf.SHADOW)


def text_width(text: str, size_px: float = 12.0) -> float:
    """How wide a line is, pixels."""
    blf.size(_FONT, size_px)
    return blf.dimensions(_FONT, text)[0]
