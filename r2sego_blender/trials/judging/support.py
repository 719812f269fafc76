"""Stable support by the chair: how long the seat bears the robot without a break."""

from __future__ import annotations

from collections import deque

import numpy as np


def longest_support(
    time_us: np.ndarray, load_n: np.ndarray, least_n: float, stability: float, enough_us: int
) -> tuple[int, int | None]:
    """The longest stable support in microseconds, and the time at which one was first ``enough_us`` long.

    ``time_us`` (n,) int64 grows, ``load_n`` (n,) is the seat's load. A support is a stretch of samples of at least
    ``least_n`` whose lowest is at least ``stability`` times its highest.
    """
    longest, complete = 0, None
    edges = np.flatnonzero(np.diff(np.r_[False, load_n >= least_n, False]))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if time_us[end - 1] - time_us[first] <= longest:
            continue
        times, loads = time_us[first:end].tolist(), load_n[first:end].tolist()
        start = 0
        # Those that are the highest or lowest of the stretch, or will be once it has lost its first ones.
        high: deque[int] = deque()
        low: deque[int] = deque()
        for index, load in enumerate(loads):
            while high and loads[high[-1]] <= load:
                high.pop()
            while low and loads[low[-1]] >= load:
                low.pop()
            high.append(index)
            low.append(index)
            while loads[low[0]] < stability * loads[high[0]]:
                start += 1
                if high[0] < start:
                    high.popleft()
                if low[0] < start:
                    low.popleft()
            longest = max(longest, times[index] - times[start])
            if complete is None and times[index] - times[start] >= enough_us:
                complete = times[index]
    return longest, complete
