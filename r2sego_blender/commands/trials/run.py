"""``r2sego trials run``, ``judge`` and ``records``: trials on hardware, and what was recorded of them."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...core.digests import content_digest
from ...core.errors import TrialError
from ...core.printable import printable
from ...core.progress import JsonProgress
from ...trials.outcome import Outcome
from ...trials.plan.trial_plan import TrialPlan
from ...trials.records.index import RECORDS_FOLDER, RecordIndex
from ...trials.records.judgement_values import judgement_values
from ...trials.running.live import LIVE_EVENT
from ..options import ANY_PATH, FOLDER, Output, output_options

if TYPE_CHECKING:
    from ...trials.outcome import Judgement
    from ...trials.records.index import Entry
    from ...trials.running.live import Live

_STUDY = click.argument("study", type=FOLDER)


@click.command("run")
@_STUDY
@click.option("--device", "url", metavar="URL", help="The device's port: /dev/ttyACM0, COM3, socket://HOST:PORT, ...")
@click.option("--adapter", default="stream", show_default=True, help="What it is: stream, mark10, mark10:CHANNEL.")
@click.option("--baud", type=int, help="By default the adapter's.")
@click.option("--calibration", "file", type=ANY_PATH, help="The device's calibration.")
@click.option("--bell", is_flag=True, help="Sound the terminal's bell: once a success, twice a failure, else thrice.")
@click.option("--simulated", is_flag=True, help="A simulated device and operator, faster than real: to try a plan.")
@output_options("--json-progress")
def run_trials(
    study: Path,
    url: str | None,
    adapter: str,
    baud: int | None,
    file: Path | None,
    bell: bool,
    simulated: bool,
    output: Output,
) -> None:
    """Run the trials of the plan in STUDY, each judged by the device's load cells.

    The terminal says what to do next and which key says that it was done; what Blender's panel says counts as
    well. A session may be stopped and begun again at any time. The emergency stop is a circuit: this only
    records it.
    """
    from ...trials.running.connection import Connection
    from ...trials.running.session import Session

    if simulated:
        from ...trials.line.simulated import simulated_calibration
        from ...trials.running.clock import SimulatedClock
        from ...trials.running.simulated import SimulatedBench, SimulatedOperator, simulated_scripts

        clock, plan = SimulatedClock(), TrialPlan.load(study)
        bench = SimulatedBench(clock)
        operator = SimulatedOperator(plan, bench, clock, simulated_scripts(plan))
        show = _as_events(output) if output.as_events else _judged_lines()
        Session(study, Connection(bench.open_line, clock), simulated_calibration(), operator, show, clock).run()
    else:
        from ...trials.calibration.calibration import Calibration
        from ...trials.line.adapters import adapter_named
        from ...trials.line.device import open_device
        from ...trials.running.clock import MachineClock
        from ...trials.running.keys import Keys, terminal_keys
        from ...trials.running.people import People
        from ...trials.running.terminal import TerminalView

        if url is None or file is None:
            raise TrialError(
                "no device and calibration are given",
                where="r2sego trials run",
                cure="Give --device URL and --calibration FILE, or --simulated.",
            )
        kind, calibration, keys = adapter_named(adapter), Calibration.load(file), Keys()
        connection = Connection(lambda: open_device(url, kind, baud), MachineClock())
        with contextlib.nullcontext() if output.as_events else terminal_keys() as reader:
            show = _as_events(output) if output.as_events else TerminalView(keys, bell).show
            Session(study, connection, calibration, People(study, keys, reader), show).run()
    counts = Counter(entry.judgement.outcome for entry in _entries(study))
    shown = [Outcome.UNUSABLE] if TrialPlan.load(study).blinded else list(Outcome)
    output.tell(records=counts.total(), **{outcome.value: counts[outcome] for outcome in shown})


@click.command("judge")
@click.argument("record", type=ANY_PATH)
@click.option("--as", "outcome", type=click.Choice(["success", "failure", "unusable"]), help="Your own judgement.")
@click.option("--by", help="Whose judgement it is.")
@click.option("--because", help="Why.")
@output_options("--json")
def judge(record: Path, outcome: str | None, by: str | None, because: str | None, output: Output) -> None:
    """Judge a record again, from the signals in it: the same each time.

    With --as, a person's judgement is added to the study's index, as one, and counts from then on.
    """
    from ...trials.judging.manual import manual_judgement
    from ...trials.records.index import RecordIndex
    from ...trials.records.reading import read_record
    from ...trials.running.about import About
    from ...trials.running.judged_record import judged_record

    if outcome is None and (by or because):
        raise TrialError("nothing is judged by hand", where="r2sego trials judge", cure="Give --as OUTCOME too.")
    read = read_record(record)
    number, judgement = About.of(read).number, judged_record(read)
    if outcome is not None:
        judgement = manual_judgement(judgement, outcome, by or "", because or "")
        index = RecordIndex(record.resolve().parents[1])
        if not any(entry.number == number and entry.name == record.name for entry in index.entries()):
            raise TrialError("this record is not in its study's index", where=record, cure="Give it where it lies.")
        index.judge(number, judgement)
    output.show({"record": number, **judgement_values(judgement)}, lambda _: _judged(number, judgement))


@click.command("records")
@_STUDY
@output_options("--json")
def records(study: Path, output: Output) -> None:
    """List a study's records, and whether each file is the one that was recorded."""
    rows = [
        {
            "record": entry.number,
            "file": entry.name,
            "trial": entry.trial + 1,
            "began": entry.began,
            "tethered": entry.tethered,
            "simulated": entry.simulated,
            "state": _state(study, entry),
            **judgement_values(entry.judgement),
        }
        for entry in _entries(study)
    ]
    output.show(rows, lambda found: [_row(one) for one in found] or ["no records"])


COMMANDS = (run_trials, judge, records)


def _entries(study: Path) -> list[Entry]:
    TrialPlan.load(study)  # raises where this is no study
    return RecordIndex(study).entries()


def _state(study: Path, entry: Entry) -> str:
    """Whether a record's file is the one that was recorded."""
    try:
        digest = content_digest(study / RECORDS_FOLDER / entry.name)
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if not digest:
        return "missing"
    if not entry.sha256:
        return "cut off" if entry.sensors is None else "not closed"
    return "whole" if digest == entry.sha256 else "changed"


def _row(one: dict[str, Any]) -> str:
    by_hand = f" by {one['manual']}" if one["manual"] else ""
    reasons = "; ".join(f"{kind.lower().replace('_', ' ')}: {text}" for kind, text in one["reasons"])
    return f"{one['file']}  trial {one['trial']:3d}  {one['outcome'].lower():8}{by_hand}  {one['state']}  {reasons}"


def _judged(number: int, judgement: Judgement) -> list[str]:
    by_hand = f", by {judgement.manual}" if judgement.manual else ""
    return [
        f"record {number}: {judgement.outcome.value}{by_hand}",
        *(f"  {kind.value}: {text}" for kind, text in judgement.reasons),
        f"  support {judgement.support_s:.2f} s, highest load on the tether {judgement.highest_tether_n:.1f} N",
    ]


def _as_events(output: Output) -> Callable[[Live], None]:
    """Tells a session as the job's events."""
    told = JsonProgress()
    return lambda live: told.emit(event=LIVE_EVENT, **live.to_json())


def _judged_lines() -> Callable[[Live], None]:
    """Tells each trial as it is judged, a line each."""
    last = 0

    def show(live: Live) -> None:
        nonlocal last
        if live.outcome is not None and live.record not in (0, last) and live.state.name == "JUDGED":
            last = live.record
            reasons = printable("; ".join(live.reasons))
            click.echo(f"record {live.record}, trial {live.index + 1} of {live.total}: {live.outcome.value}  {reasons}")

    return show
