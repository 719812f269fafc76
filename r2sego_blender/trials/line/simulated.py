"""A device without hardware: a program that sends what a board would, behind a terminal of its own.

It is the C++ program in ``trials/firmware``, which frames its lines with the board's own header and is compiled
once into the person's cache, or without a compiler the same in Python. Where the system has no such terminals
(Windows), it is behind a socket of this machine.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from ...core.errors import TrialError
from ...core.scratch import ScratchFolder
from ...core.user_configuration import cache_folder
from ...workers.library_path import IMPORT_LIBRARY
from ...workers.processes import NO_WINDOW
from ..calibration.calibration import Calibration, ChannelCalibration, Point
from ..stream import Channel

FIRMWARE = Path(__file__).resolve().parents[1] / "firmware"
DEVICE = "simulated"

_LIMIT = 1 << 23
_CELLS: Mapping[str, tuple[int, int]] = {"tether": (84210, 812), "seat": (-21340, 640)}
"""Counts without load, and counts a newton."""

Loads = tuple[tuple[int, int], ...]
_EVER = 1 << 40


@dataclass(frozen=True)
class Script:
    """What happens at a simulated device.

    ``tether`` and ``seat`` are points (ms, mN) between which loads are straight lines, ``effect`` is what goes
    wrong in ``from_ms`` <= t < ``to_ms``: as in ``firmware/simulated_device.cpp``.
    """

    tether: Loads
    seat: Loads
    effect: str = "none"
    from_ms: int = 0
    to_ms: int = _EVER

    def line(self, seed: int) -> str:
        """As the program reads it."""
        words: list[object] = [seed, self.effect, self.from_ms, self.to_ms]
        for loads in (self.tether, self.seat):
            words += [len(loads), *(number for load in loads for number in load)]
        return " ".join(map(str, words)) + "\n"


_SLACK: Loads = ((0, 3_000),)
_SITS: Loads = ((0, 0), (2_000, 0), (2_300, 290_000), (2_500, 255_000), (2_700, 260_000))
_EMPTY: Loads = ((0, 0),)

SCRIPTS: Mapping[str, Script] = {
    "idle": Script(_SLACK, _EMPTY),
    "unloaded": Script(_EMPTY, _EMPTY),
    "success": Script(_SLACK, _SITS),
    "tether": Script(((0, 3_000), (2_400, 3_000), (2_600, 210_000)), _EMPTY),
    "fall": Script(
        ((0, 3_000), (3_400, 3_000), (3_550, 320_000)),
        ((0, 0), (2_000, 0), (2_300, 240_000), (3_200, 220_000), (3_400, 0)),
    ),
    "stop": Script(_SLACK, _SITS, "stop", 3_000),
    "saturation": Script(_SLACK, _SITS, "saturation", 3_000, 3_100),
    "fault": Script(_SLACK, _SITS, "fault", 3_000, 3_100),
    "gap": Script(_SLACK, _SITS, "silence", 3_000, 3_120),
    "silence": Script(_SLACK, _SITS, "silence", 3_000, 3_500),
    "loss": Script(_SLACK, _SITS, "loss", 1_000),
    "reset": Script(_SLACK, _SITS, "reset", 3_000),
    "drift": Script(_SLACK, _SITS, "drift"),
    "noise": Script(_SLACK, _SITS, "noise", 3_000, 3_500),
    "unplug": Script(_SLACK, _SITS, "unplug", 3_000),
}
"""By name: the robot on a slack tether (3 N), how its trial goes, and what goes wrong with the device.

``gap`` is 120 ms without samples, ``silence`` half a second, ``loss`` every twentieth sample, ``drift`` a clock
that is 2 % fast, ``noise`` damages every seventh line for half a second; ``unplug`` ends at 3 s.
"""


def script_named(name: str) -> Script:
    """A script by its name, or ``weights:TETHER_KG:SEAT_KG``. Raises TrialError for another."""
    if name in SCRIPTS:
        return SCRIPTS[name]
    kind, *weights = name.split(":")
    with contextlib.suppress(ValueError, OverflowError):
        if kind == "weights" and len(weights) == 2:
            tether, seat = (((0, round(float(one) * 9806.65)),) for one in weights)
            return Script(tether, seat)
    raise TrialError(
        f"no script is called {name[:40]}", cure=f"Known: {', '.join(SCRIPTS)}, weights:TETHER_KG:SEAT_KG."
    )


def simulated_calibration(taken: datetime | None = None) -> Calibration:
    """The calibration that is exactly a simulated device's, taken now or then."""
    channels = tuple(
        ChannelCalibration(
            Channel(name, -_LIMIT, _LIMIT - 1),
            tuple(Point(load, zero + per_newton * load, 0.0) for load in (0.0, 100.0, 300.0)),
        )
        for name, (zero, per_newton) in _CELLS.items()
    )
    return Calibration(DEVICE, "1.0", taken or datetime.now(UTC).replace(microsecond=0), channels)


def simulated_device(
    script: str = "idle",
    seed: int = 0,
    rate_hz: float = 200,
    speed: float = 1.0,
    language: Literal["c++", "python"] | None = None,
    over: Literal["terminal", "socket"] | None = None,
) -> SimulatedDevice:
    """A device that plays the script of that name, by the same ``seed`` with the same bytes.

    In its ``with`` block it is plugged in, and gives its URL. Its clock and samples go ``speed`` times as fast as
    this machine's. ``language`` is by default C++ where g++ is, ``over`` a terminal where there are such.
    """
    return SimulatedDevice(script, seed, round(rate_hz), speed, language, over or ("socket" if _NO_PTY else "terminal"))


_NO_PTY = sys.platform == "win32"


class SimulatedDevice:
    """A simulated device; ``simulated_device`` makes it. ``url`` stays the same when it is plugged in again.

    Any thread may plug it in, unplug it, or let it play.
    """

    def __init__(self, script: str, seed: int, rate_hz: int, speed: float, language: str | None, over: str) -> None:
        self._script = script_named(script).line(seed)
        self._rate_hz, self._speed, self._starts = rate_hz, speed, 0
        self._program = device_program(language)
        self._process: subprocess.Popen | None = None
        self._plugging = threading.RLock()
        self._end: _Terminal | _Socket = _Terminal() if over == "terminal" else _Socket()
        self.url = self._end.url

    def __enter__(self) -> str:
        self.plug_in()
        return self.url

    def __exit__(self, *_: object) -> None:
        self.unplug()
        self._end.close()

    @property
    def is_plugged_in(self) -> bool:
        """Whether it is there; scripts may unplug it."""
        return self._process is not None and self._process.poll() is None

    def play(self, script: str, seed: int = 0) -> None:
        """Go on with another script, from its start; the device itself does not restart. Plugs it in."""
        with self._plugging:
            self._script = script_named(script).line(seed)
            if self.is_plugged_in:
                self._tell()
            else:
                self.plug_in()

    def unplug(self) -> None:
        """As its cable is drawn: whoever reads it loses the line."""
        with self._plugging:
            if self._process is not None:
                self._process.kill()
                self._process.wait()
                with contextlib.suppress(OSError):  # what it was last told has nowhere to go
                    self._process.stdin.close()  # type: ignore[union-attr]
                self._process = None
            self._end.unplug()

    def plug_in(self) -> None:
        """A new start of the device, with the script from its beginning."""
        with self._plugging:
            self.unplug()
            self._starts += 1
            arguments = [self._rate_hz, self._starts * 1000, self._speed, 0, *cell_arguments()]
            self._process = self._end.start([*self._program, *map(str, arguments)])
            self._tell()

    def _tell(self) -> None:
        assert self._process is not None and self._process.stdin is not None
        with contextlib.suppress(OSError):  # it has just ended
            self._process.stdin.write(self._script.encode())
            self._process.stdin.flush()


def device_program(language: str | None = None) -> list[str]:
    """The command of the program in C++, compiled now if need be, or in Python; by default the first that is here."""
    compiled = _compiled() if language != "python" else None
    if compiled is not None:
        return [str(compiled)]
    if language == "c++":
        raise TrialError("g++ is not installed, or does not compile the simulated device", cure="Install g++.")
    module = f"{__package__.split('.')[0]}.trials.line.simulated_program"
    return [sys.executable, "-c", f"{IMPORT_LIBRARY}from {module} import main\nmain()\n"]


def cell_arguments() -> list[object]:
    """A simulated device's cells, as its program is told them."""
    return [word for name, cell in _CELLS.items() for word in (name, -_LIMIT, _LIMIT - 1, *cell)]


@functools.cache
def _compiled() -> Path | None:
    """The compiled program, in the person's cache by its sources' digest; None where it cannot be made."""
    compiler = shutil.which("g++")
    if compiler is None or _NO_PTY:
        return None
    sources = [FIRMWARE / "simulated_device.cpp", FIRMWARE / "r2sego_trials" / "r2sego_line.h"]
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    try:
        place = cache_folder() / f"simulated-device-{digest}"
        if place.is_file():
            return place
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix=".unfinished-") as folder:
            made = Path(folder, "device")
            command = [compiler, "-std=c++17", "-O2", "-o", str(made), str(sources[0])]
            if subprocess.run(command, capture_output=True).returncode:
                return None
            made.replace(place)
    except (OSError, RuntimeError):  # a read-only home, or none
        return None
    return place


class _Terminal:
    """A terminal whose other side is a device; its name is a link, which stays when it is opened anew."""

    def __init__(self) -> None:
        self._folder = ScratchFolder()
        self.url = str(Path(self._folder.name, "device"))
        self._kept: int | None = None

    def start(self, command: list[str]) -> subprocess.Popen:
        import pty
        import tty

        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        self._kept = theirs  # else it hangs up whenever nobody has it open
        fresh = Path(f"{self.url}.new")
        fresh.symlink_to(os.ttyname(theirs))
        fresh.replace(self.url)
        try:
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=ours)
        finally:
            os.close(ours)  # it is the program's alone: gone with it

    def unplug(self) -> None:
        Path(self.url).unlink(missing_ok=True)
        if self._kept is not None:
            os.close(self._kept)
            self._kept = None

    def close(self) -> None:
        self._folder.cleanup()


class _Socket:
    """A port of this machine, at which one at a time may read a device."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as found:
            self._address = found.getsockname()
        self.url = f"socket://{self._address[0]}:{self._address[1]}"
        self._passing: threading.Thread | None = None
        self._reader: socket.socket | None = None

    def start(self, command: list[str]) -> subprocess.Popen:
        listener = socket.create_server(self._address)
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **NO_WINDOW)
        threading.Thread(target=self._accept, args=(listener,), daemon=True).start()
        self._passing = threading.Thread(target=self._pass_on, args=(process, listener), daemon=True)
        self._passing.start()
        return process

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):  # it was closed
            while True:
                reader, _ = listener.accept()
                reader.settimeout(1.0)
                before, self._reader = self._reader, reader
                _hang_up(before)

    def _pass_on(self, process: subprocess.Popen, listener: socket.socket) -> None:
        assert process.stdout is not None
        with process.stdout as sent:
            while data := os.read(sent.fileno(), 4096):
                reader = self._reader
                try:
                    if reader is not None:
                        reader.sendall(data)
                except OSError:
                    self._reader = None
                    _hang_up(reader)
        _hang_up(listener)
        _hang_up(self._reader)
        self._reader = None

    def unplug(self) -> None:
        """After its program was killed."""
        if self._passing is not None:
            self._passing.join()
            self._passing = None

    def close(self) -> None:
        pass


def _hang_up(end: socket.socket | None) -> None:
    if end is not None:
        with contextlib.suppress(OSError):  # what waits for it elsewhere is woken
            end.shutdown(socket.SHUT_RDWR)
        end.close()
