"""``r2sego trials calibrate``, ``self-test``, ``watch``, ``simulate`` and ``sketch``: the device by itself."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...core.atomic_files import unwritable
from ...core.errors import TrialError
from ..options import ANY_PATH, FOLDER, NEW_FILE, Output, output_options, overrides_of

if TYPE_CHECKING:
    from ...trials.calibration.calibration import Calibration
    from ...trials.line.decoding import Message, Sample
    from ...trials.line.simulated import SimulatedDevice
    from ...trials.stream import Hello, Stream

SKETCH = "r2sego_trials"
_SHOW_S = 0.1


def device_options(command: Callable) -> Callable:
    """The argument URL, and the options that say what is there."""
    command = click.option("--baud", type=int, help="By default the adapter's, 115200.")(command)
    adapter = click.option(
        "--adapter", default="stream", show_default=True, help="What it is: stream, mark10, mark10:CHANNEL."
    )
    return click.argument("url")(adapter(command))


@click.command("calibrate")
@device_options
@click.option("--to", "file", type=NEW_FILE, required=True, metavar="FILE", help="Where the calibration goes.")
@click.option(
    "--weight",
    "weights",
    multiple=True,
    required=True,
    metavar="CHANNEL=KG",
    help="A known weight, in the order in which they are put on: one a channel, or two to see if it is straight.",
)
@click.option("--seconds", default=3.0, show_default=True, help="How long each load is measured.")
@output_options("--json")
def calibrate_device(
    url: str, adapter: str, baud: int | None, file: Path, weights: tuple[str, ...], seconds: float, output: Output
) -> None:
    """Calibrate the device at URL with known weights: zero and span of each load cell.

    It says what to put on and waits for Enter. How far each load is off the straight line is shown; more than
    1 % of the largest is a cell to mend.
    """
    from ...trials.line.adapters import adapter_named
    from ...trials.line.calibrating import calibrate
    from ...trials.line.listening import listen

    kind = adapter_named(adapter)
    given = [
        (name, _kilograms(value)) for one in weights for name, value in overrides_of((one,), "--weight A=KG").items()
    ]

    _require_seconds(seconds)
    if reason := unwritable(file.parent):  # told before a person has put on every weight
        cure = "Name a folder that you may write in."
        raise TrialError(f"no calibration can be written here: {reason}", where=file, cure=cure)

    def measure(words: str) -> tuple[Hello, Stream]:
        click.echo(f"{words} Then press Enter. ", err=True, nl=False)
        if not sys.stdin.readline():
            raise TrialError("nobody pressed Enter", where="r2sego trials calibrate", cure="Run it in a terminal.")
        return listen(url, kind, baud, seconds)

    calibration = calibrate(given, measure)
    calibration.save(file)
    output.show(_calibration_values(calibration, file), _calibration_lines)


@click.command("self-test")
@device_options
@click.option("--calibration", "file", type=ANY_PATH, required=True, help="The device's calibration.")
@output_options("--json")
def self_test(url: str, adapter: str, baud: int | None, file: Path, output: Output) -> None:
    """Test the device at URL as before each session: tether slack, seat empty."""
    from ...trials.calibration.calibration import Calibration
    from ...trials.line.adapters import adapter_named
    from ...trials.line.listening import messages
    from ...trials.line.self_test import LONGEST_S, SelfTest

    calibration, test, until_s = Calibration.load(file), None, 0.0
    for hello, found in messages(url, adapter_named(adapter), baud):
        if test is None:
            test, until_s = SelfTest(hello, calibration), time.monotonic() + LONGEST_S
        test.add(found)
        if test.complete or time.monotonic() >= until_s:
            break
    assert test is not None
    if not test.complete:
        what = f"the self-test failed: {'; '.join(test.problems)}"
        raise TrialError(what, where=url, cure="See to its sketch, then test again.")
    rows: list[dict[str, Any]] = [
        {"what": what, "measured": measured, "right": right} for what, measured, right in test.results
    ]
    age = calibration.age_days(time.time())
    rows.append({"what": "calibration's age", "measured": f"{age:.1f} days", "right": age >= 0})
    output.show(
        rows,
        lambda found: [f"{'ok   ' if one['right'] else 'WRONG'} {one['what']}: {one['measured']}" for one in found],
    )
    wrong = [one["what"] for one in rows if not one["right"]]
    if wrong:
        raise TrialError(f"the self-test failed: {', '.join(wrong)}", where=url, cure="Mend it before the session.")


@click.command("watch")
@device_options
@click.option("--calibration", "file", type=ANY_PATH, help="Show newtons by it, and not counts.")
@click.option("--seconds", type=float, help="End after so long; by default at Ctrl-C.")
@output_options("--json-progress")
def watch(url: str, adapter: str, baud: int | None, file: Path | None, seconds: float | None, output: Output) -> None:
    """Show what the device at URL sends, ten times a second."""
    from ...trials.calibration.calibration import Calibration
    from ...trials.line.adapters import adapter_named
    from ...trials.line.listening import messages

    if seconds is not None:
        _require_seconds(seconds)
    calibration = Calibration.load(file) if file else None
    shown: _Watched | None = None
    ends_s = time.monotonic() + seconds if seconds is not None else None
    for hello, found in messages(url, adapter_named(adapter), baud):
        shown = shown or _Watched(hello, calibration, output)
        shown.add(found)
        if ends_s is not None and time.monotonic() >= ends_s:
            break
    if not output.as_events:
        click.echo()


class _Watched:
    """The newest values and how the line does, told anew every 0.1 s."""

    def __init__(self, hello: Hello, calibration: Calibration | None, output: Output) -> None:
        if calibration is not None:
            calibration.check_device(hello)
        self._hello, self._calibration, self._output = hello, calibration, output
        self._last: int | None = None
        self._told: Sample | None = None
        self._samples = self._missing = self._damaged = 0
        self._told_s = time.monotonic()
        channels = ", ".join(one.name for one in hello.channels)
        if not output.as_events:
            click.echo(f"{hello.device}, firmware {hello.firmware}, {hello.rate_hz:g} Hz, channels {channels}")

    def add(self, found: list[Message]) -> None:
        """Go on with what came."""
        from ...trials.line.decoding import Damaged, Sample
        from ...trials.line.framing import SEQUENCES

        samples = [one for one in found if isinstance(one, Sample) and len(one.raw) == len(self._hello.channels)]
        self._damaged += sum(isinstance(one, Damaged) for one in found)
        for sample in samples:
            if self._last is not None:
                self._missing += (sample.sequence - self._last - 1) % SEQUENCES
            self._last = sample.sequence
        self._samples += len(samples)
        now_s = time.monotonic()
        if samples and now_s - self._told_s >= _SHOW_S:
            self._tell(samples[-1])
            self._told_s, self._told, self._samples = now_s, samples[-1], 0
        elif self._damaged and self._told is None and not self._output.as_events:
            click.echo(f"\rno samples  damaged {self._damaged}", nl=False)  # as at another rate, or of another kind

    def _tell(self, sample: Sample) -> None:
        import numpy as np

        from ...trials.line.framing import CLOCK_US
        from ...trials.stream import Flags

        raw, flags = sample.raw, sample.flags
        passed_us = (sample.device_us - self._told.device_us) % CLOCK_US if self._told else 0
        rate_hz = self._samples / passed_us * 1e6 if passed_us else self._hello.rate_hz
        values = raw if self._calibration is None else self._calibration.newtons(np.array([raw]))[0].tolist()
        told: dict[str, Any] = {one.name: value for one, value in zip(self._hello.channels, values, strict=True)}
        if self._output.as_events:
            self._output.tell(values=told, flags=flags, rate_hz=rate_hz, missing=self._missing, damaged=self._damaged)
            return
        shown = "  ".join(
            f"{name} {value:9.1f} N" if self._calibration else f"{name} {value:9d}" for name, value in told.items()
        )
        words = ", ".join(flag.name or "" for flag in Flags if flags & flag)
        click.echo(
            f"\r{shown}  {rate_hz:6.1f} Hz  missing {self._missing}  damaged {self._damaged}  {words:30}", nl=False
        )


@click.command("simulate")
@click.argument("script", default="idle")
@click.option("--seed", default=0, show_default=True, help="The same seed sends the same bytes.")
@click.option("--rate", default=200, show_default=True, type=click.IntRange(1, 2000), help="Samples a second.")
@click.option("--calibration", "file", type=NEW_FILE, metavar="FILE", help="Write its calibration there.")
@click.option("--socket", is_flag=True, help="Behind a socket of this machine and not a terminal; on Windows always.")
def simulate(script: str, seed: int, rate: int, file: Path | None, socket: bool) -> None:
    """Simulate a device that plays SCRIPT, until Ctrl-C: its URL is the first line.

    Each name of a script that is typed is played from then on: idle, success, tether, fall, stop, saturation,
    fault, gap, silence, loss, reset, drift, noise, unplug, or weights:TETHER_KG:SEAT_KG.
    """
    from ...trials.line.simulated import simulated_calibration, simulated_device

    device = simulated_device(script, seed, rate, over="socket" if socket else None)
    with device as url:
        if file is not None:
            simulated_calibration().save(file)
        click.echo(url)
        click.echo(f"playing {script}; type another script's name to play it, Ctrl-C to end", err=True)
        _follow(device, seed)


def _follow(device: SimulatedDevice, seed: int) -> None:
    """Play what is typed; without a terminal, what was given until the end."""
    try:
        while line := sys.stdin.readline():
            if name := line.strip():
                try:
                    device.play(name, seed)
                except TrialError as error:
                    click.echo(str(error), err=True)
        while True:
            time.sleep(3600.0)
    except KeyboardInterrupt:
        return


@click.command("sketch")
@click.argument("folder", type=FOLDER)
def sketch(folder: Path) -> None:
    """Write the reference sketch for Arduino-class boards into FOLDER, as the Arduino IDE opens it."""
    from ...trials.line.simulated import FIRMWARE

    to = folder / SKETCH
    if to.exists():
        raise TrialError("something is there", where=to, cure="Give another folder, or take it away.")
    shutil.copytree(FIRMWARE / SKETCH, to)
    click.echo(str(to / f"{SKETCH}.ino"))


COMMANDS = (calibrate_device, self_test, watch, simulate, sketch)


def _require_seconds(seconds: float) -> None:
    if not 0.0 < seconds < math.inf:
        raise TrialError(f"{seconds:g} seconds are no time", where="--seconds", cure="Give more than 0.")


def _kilograms(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise TrialError(
            f"'{text}' is no number of kilograms", where="--weight", cure="As --weight seat=10."
        ) from error


def _calibration_values(calibration: Calibration, file: Path) -> dict[str, Any]:
    channels = [
        {
            "name": one.channel.name,
            "counts_per_newton": one.counts_per_newton,
            "zero_counts": one.zero,
            "newtons": [point.newtons for point in one.points],
            "residuals_n": list(one.residuals_n),
            "noise_n": [abs(point.spread / one.counts_per_newton) for point in one.points],
        }
        for one in calibration.channels
    ]
    return {"file": str(file), "device": calibration.device, "sha256": calibration.digest, "channels": channels}


def _calibration_lines(values: dict[str, Any]) -> list[str]:
    lines = [f"{values['device']}: {values['file']}, sha256 {values['sha256']}"]
    for one in values["channels"]:
        lines.append(
            f"{one['name']}: {one['counts_per_newton']:.3f} counts/N, {one['zero_counts']:.1f} counts without load"
        )
        largest = max(one["newtons"])
        for load, residual, noise in zip(one["newtons"], one["residuals_n"], one["noise_n"], strict=True):
            share = f"{100 * residual / largest:+.3f} %"
            lines.append(
                f"  {load:8.2f} N: off the line by {residual:+.3f} N ({share} of the largest), noise {noise:.3f} N"
            )
    return lines
