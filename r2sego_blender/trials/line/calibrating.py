"""Calibrating a device: nothing on its cells, then known weights on each, one after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime

from ...core.errors import TrialError
from ..calibration.calibration import STANDARD_GRAVITY, Calibration, ChannelCalibration, Point
from ..stream import Flags, Hello, Stream

FEWEST_SAMPLES = 20
MOST_KG = 10_000.0

Measure = Callable[[str], tuple[Hello, Stream]]
"""Has a person do what the words say, and gives what the device then sends at rest."""


def calibrate(weights: Sequence[tuple[str, float]], measure: Measure) -> Calibration:
    """The calibration of a device with known ``weights``, pairs of a channel's name and kilograms, in their order.

    Raises TrialError: a channel without a weight, one that is not there, or loads that were not at rest.
    """
    hello, empty = measure("Take every load off all cells.")
    names = [channel.name for channel in hello.channels]
    for name, kg in weights:
        if name not in names or not (math.isfinite(kg) and 0.0 < kg <= MOST_KG):
            raise TrialError(f"{kg:g} kg on {name} is no weight here", cure=f"Channels are: {', '.join(names)}.")
    if missing := [name for name in names if name not in [one for one, _ in weights]]:
        raise TrialError(f"no weight is given for {', '.join(missing)}", cure=f"Give --weight {missing[0]}=KG too.")
    points = {name: [_point(0.0, empty, index)] for index, name in enumerate(names)}
    for name, kg in weights:
        now, stream = measure(f"Put {kg:g} kg on {name}, nothing else on it, and let it come to rest.")
        if (now.device, now.channels) != (hello.device, hello.channels):
            raise TrialError("this is another device now", where=now.device, cure="Calibrate one after the other.")
        points[name].append(_point(kg * STANDARD_GRAVITY, stream, names.index(name)))
    taken = datetime.now(UTC).replace(microsecond=0)
    channels = tuple(ChannelCalibration(one, tuple(points[one.name])) for one in hello.channels)
    return Calibration(hello.device, hello.firmware, taken, channels)


def _point(newtons: float, stream: Stream, index: int) -> Point:
    name = stream.channels[index].name
    if len(stream.raw) < FEWEST_SAMPLES:
        raise TrialError(f"only {len(stream.raw)} samples came", where=name, cure="Give a longer --seconds.")
    if (stream.flags & (Flags.SATURATED | Flags.SENSOR_FAULT)).any():
        raise TrialError("a channel is at its end or cannot be read", where=name, cure="See to its wiring and range.")
    counts = stream.raw[:, index]
    return Point(newtons, float(counts.mean()), float(counts.std()))
