"""The program of a simulated device in plain Python, where no compiler is.

The same arguments, input and bytes as ``firmware/simulated_device.cpp``, where they are described.
"""

from __future__ import annotations

import itertools
import os
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

from .framing import CLOCK_US, SEQUENCES, hello_line, sample_line

_FIRST_US, _FIRST_SEQUENCE = CLOCK_US - 3_000_000, 65_000
_NOISE = 150
_MASK = (1 << 32) - 1
_FLAGS = {"stop": 1, "saturation": 2, "fault": 4}  # ``stream.Flags``; without NumPy it starts at once


class _Random:
    """xorshift32."""

    def __init__(self, seed: int) -> None:
        self._state = seed * 2654435761 & _MASK | 1

    def next(self) -> int:
        state = self._state
        state ^= state << 13 & _MASK
        state ^= state >> 17
        state ^= state << 5 & _MASK
        self._state = state
        return state >> 8


@dataclass(frozen=True)
class Cell:
    """A load cell: its range and its counts without load, and a newton."""

    name: str
    lowest: int
    highest: int
    zero: int
    counts_per_newton: int


@dataclass(frozen=True)
class ProgramScript:
    """What the program plays, as one line of its input."""

    seed: int
    effect: str
    from_ms: int
    to_ms: int
    loads: tuple[tuple[tuple[int, int], ...], ...]

    @staticmethod
    def parse(line: str, channels: int) -> ProgramScript:
        """Of a line of the program's input."""
        seed, effect, from_ms, to_ms, *left = line.split()
        numbers = [int(one) for one in left]
        loads = []
        for _ in range(channels):
            count, *numbers = numbers
            loads.append(tuple(zip(numbers[: 2 * count : 2], numbers[1 : 2 * count : 2], strict=True)))
            numbers = numbers[2 * count :]
        return ProgramScript(int(seed), effect, int(from_ms), int(to_ms), tuple(loads))


def _load_at(loads: tuple[tuple[int, int], ...], ms: int) -> int:
    if not loads or ms <= loads[0][0]:
        return loads[0][1] if loads else 0
    for (a_ms, a), (b_ms, b) in itertools.pairwise(loads):
        if ms < b_ms:
            return (a * (b_ms - ms) + b * (ms - a_ms)) // (b_ms - a_ms)
    return loads[-1][1]


class DeviceProgram:
    """The device itself: ``play`` gives it a script from its start, ``step`` the bytes of one sample's time."""

    def __init__(self, rate_hz: int, boot: int, cells: Sequence[Cell]) -> None:
        self._rate_hz, self._boot, self._cells = rate_hz, boot, cells
        self._channels = [(cell.name, cell.lowest, cell.highest) for cell in cells]
        self._tick = self._begun = self._clock = 0
        self._first_us, self._sequence = _FIRST_US, _FIRST_SEQUENCE
        self._hello_due = True

    def play(self, script: ProgramScript) -> None:
        """Go on with a script, from its start."""
        self._script, self._begun, self._was_reset = script, self._tick, False
        self._noise, self._damage = _Random(script.seed), _Random(script.seed + 1)

    def step(self) -> bytes | None:
        """What is sent in one sample's time; None when the device is gone."""
        script = self._script
        ms = (self._tick - self._begun) * 1000 // self._rate_hz
        effect = script.effect if script.from_ms <= ms < script.to_ms else "none"
        if effect == "unplug":
            return None
        if effect == "reset" and not self._was_reset:
            self._was_reset = self._hello_due = True
            self._boot += 1
            self._sequence = self._first_us = self._clock = 0
        self._clock += 1_000_000 * (102 if effect == "drift" else 100)
        self._hello_due |= self._tick % self._rate_hz == 0
        self._tick += 1
        raw = []
        for cell, loads in zip(self._cells, script.loads, strict=True):
            load = _load_at(loads, ms) * cell.counts_per_newton
            towards_zero = load // 1000 if load >= 0 else -(-load // 1000)
            raw.append(cell.zero + towards_zero + self._noise.next() % (2 * _NOISE + 1) - _NOISE)
        if effect == "silence":
            return b""
        if effect == "saturation":
            raw[-1] = self._cells[-1].highest
        sent = b""
        if self._hello_due:
            sent = hello_line("simulated", "1.0", self._boot, self._rate_hz, self._channels)
            self._hello_due = False
        sequence = self._sequence
        self._sequence = (sequence + 1) % SEQUENCES
        if effect == "loss" and sequence % 20 == 0:
            return sent
        device_us = (self._first_us + self._clock // (100 * self._rate_hz)) % CLOCK_US
        line = sample_line(sequence, device_us, raw, _FLAGS.get(effect, 0))
        return sent + (self._damaged(line) if effect == "noise" and sequence % 7 == 0 else line)

    def _damaged(self, line: bytes) -> bytes:
        changed = bytearray(line)
        changed[self._damage.next() % len(line)] ^= 1 + self._damage.next() % 255
        changed += bytes(self._damage.next() & 255 for _ in range(self._damage.next() % 8))
        return bytes(changed)


def _put(data: bytes) -> None:
    while data:
        try:
            data = data[os.write(1, data) :]
        except BlockingIOError:  # nobody reads: lost, as on a wire
            return


def cells_of(words: Sequence[object]) -> list[Cell]:
    """The cells of the program's arguments."""
    given = list(map(str, words))
    return [Cell(given[at], *map(int, given[at + 1 : at + 5])) for at in range(0, len(given), 5)]


def main() -> None:
    """Run the device that the arguments describe."""
    rate_hz, boot, speed, ticks = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
    cells = cells_of(sys.argv[5:])
    device = DeviceProgram(rate_hz, boot, cells)
    device.play(ProgramScript.parse(sys.stdin.readline(), len(cells)))
    scripts: list[ProgramScript] = []

    def listen() -> None:
        for line in sys.stdin:
            scripts.append(ProgramScript.parse(line, len(cells)))
        os._exit(0)

    if not ticks:
        threading.Thread(target=listen, daemon=True).start()
    begun_s, tick = time.monotonic(), 0
    while not ticks or tick < ticks:
        if scripts:
            device.play(scripts.pop())
        sent = device.step()
        if sent is None:
            return
        _put(sent)
        tick += 1
        left_s = begun_s + tick / (rate_hz * speed) - time.monotonic()
        if not ticks and left_s > 0.001:
            time.sleep(left_s)


if __name__ == "__main__":
    main()
