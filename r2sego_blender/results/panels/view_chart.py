"""Where a chart over the frames of a rollout lies in a region of the screen. Pixels; no bpy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

_HEIGHT_PX, _MARGIN_PX, _TITLE_PX = 96.0, 12.0, 18.0
_NARROWEST_PX = 120.0


@dataclass(frozen=True)
class Chart:
    """A chart's plotting rectangle, pixels from the region's lower left corner.

    Frames ``first`` to ``last`` run from its left to its right, values from 0 to 1 upwards.
    """

    left: float
    bottom: float
    width: float
    height: float
    first: int
    last: int

    def x_of(self, frame: Any) -> Any:
        """The column of a frame, or of many."""
        return self.left + (frame - self.first) / max(1, self.last - self.first) * self.width

    def y_of(self, value: Any) -> Any:
        """The row of a value, or of many."""
        return self.bottom + np.clip(value, 0.0, 1.0) * self.height

    def frame_at(self, x: float) -> float:
        """The frame at a column, within the chart."""
        share = min(1.0, max(0.0, (x - self.left) / self.width))
        return self.first + share * (self.last - self.first)

    def contains(self, x: float, y: float, slack: float = 0.0) -> bool:
        """Whether a place is in the chart, or at most ``slack`` beside it."""
        inside = -slack <= x - self.left <= self.width + slack
        return inside and -slack <= y - self.bottom <= self.height + slack


def chart_in(
    size: tuple[float, float], margins: tuple[float, float, float], scale: float, frames: np.ndarray
) -> Chart | None:
    """The chart at the bottom of a region of this ``size``; None where there is no room for it.

    ``margins`` (left, right, bottom) are covered by other regions; ``scale`` is the
    interface's; ``frames`` (n,) are those that are drawn.
    """
    margin = _MARGIN_PX * scale
    left, right = margins[0] + margin, size[0] - margins[1] - margin
    bottom = margins[2] + margin
    height = min(_HEIGHT_PX * scale, 0.3 * size[1])
    if right - left < _NARROWEST_PX * scale or height < 2.0 * _TITLE_PX * scale or not len(frames):
        return None
    first, last = int(frames.min()), int(frames.max())
    return Chart(left, bottom, right - left, height, first, last)


def curve(chart: Chart, frames: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(2 S, 2) float32: the segments of a curve through (n,) ``values`` at ascending ``frames``.

    Frames that are left out leave a gap.
    """
    points = np.stack([chart.x_of(frames), chart.y_of(values)], axis=1).astype(np.float32)
    joined = np.diff(frames) == 1
    return np.stack([points[:-1][joined], points[1:][joined]], axis=1).reshape(-1, 2)


def stems(chart: Chart, frames: np.ndarray, share: float) -> np.ndarray:
    """(2 n, 2) float32: an upright line at each frame, from the bottom to ``share`` of the height."""
    x = np.repeat(chart.x_of(np.asarray(frames, np.float64)), 2)
    y = np.tile([chart.bottom, chart.bottom + share * chart.height], len(frames))
    return np.stack([x, y], axis=1).astype(np.float32)


def covered_margins(window: Any, others: Iterable[Any]) -> tuple[float, float, float]:
    """What other regions cover of the region ``window`` at its left, right and bottom, pixels.

    Regions have ``x``, ``y``, ``width`` and ``height`` on the screen; a hidden one is 1 wide
    or high.
    """
    left = right = bottom = 0.0
    for other in others:
        if other.width <= 1 or other.height <= 1:
            continue
        x, y = other.x - window.x, other.y - window.y
        if not (0 <= x + other.width / 2 <= window.width and 0 <= y + other.height / 2 <= window.height):
            continue
        if other.height >= other.width:
            if x + other.width / 2 < window.width / 2:
                left = max(left, x + other.width)
            else:
                right = max(right, window.width - x)
        elif y + other.height / 2 < window.height / 2:
            bottom = max(bottom, y + other.height)
    return left, right, bottom
