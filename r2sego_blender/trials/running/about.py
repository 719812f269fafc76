"""What a record says of its trial before anything was received: all that its judgement needs beside the signals."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from ...config.declared_files import Reader
from ...core.errors import TrialError
from ..calibration.calibration import Calibration
from ..line.adapters import Adapter, adapter_named
from ..line.decoding import Decoder
from ..line.framing import hello_line
from ..plan.rules import Rules
from ..plan.trial_plan import PlannedTrial
from ..records.reading import Record
from ..stream import Hello

_FORMAT = 1


@dataclass(frozen=True)
class About:
    """The record ``number`` of a ``trial`` of the plan with the digest ``plan``, by its ``rules``.

    ``hello`` is what the device said last before the record began; ``simulated`` whether it was none.
    """

    number: int
    plan: str
    trial: PlannedTrial
    tethered: bool
    rules: Rules
    calibration: Calibration | None
    adapter: Adapter
    hello: Hello
    url: str
    simulated: bool

    def to_json(self) -> dict[str, Any]:
        """JSON values, of which ``of`` makes it again."""
        hello = self.hello
        channels = [(channel.name, channel.lowest, channel.highest) for channel in hello.channels]
        line = hello_line(hello.device, hello.firmware, hello.boot, int(hello.rate_hz), channels)
        return {
            "format": _FORMAT,
            "number": self.number,
            "plan": self.plan,
            "trial": dataclasses.asdict(self.trial),
            "policy_sha256": self.trial.policy_sha256,
            "tethered": self.tethered,
            "rules": dataclasses.asdict(self.rules),
            "calibration": None if self.calibration is None else self.calibration.to_values(),
            "calibration_sha256": None if self.calibration is None else self.calibration.digest,
            "adapter": self.adapter.name,
            "hello": line.decode("ascii"),
            "url": self.url,
            "simulated": self.simulated,
        }

    @staticmethod
    def of(record: Record) -> About:
        """What a record says. Raises TrialError where it is damaged, or not of this version."""
        values, reader = record.about, Reader(record.file, "record of a trial", TrialError, strict=False)
        try:
            if values["format"] != _FORMAT:
                raise ValueError("it is of another version")
            calibration = values["calibration"]
            return About(
                number=_whole(values["number"]),
                plan=str(values["plan"])[:64],
                trial=reader.table(PlannedTrial, values["trial"], "trial"),
                tethered=values["tethered"] is True,
                rules=reader.table(Rules, values["rules"], "rules"),
                calibration=None if calibration is None else Calibration.of_values(calibration),
                adapter=adapter_named(str(values["adapter"])),
                hello=_hello(str(values["hello"])),
                url=str(values["url"])[:1000],
                simulated=values["simulated"] is True,
            )
        except (TrialError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            why = error.what if isinstance(error, TrialError) else error
            raise TrialError(
                f"this record does not say what it is of: {why}", where=record.file, cure="Take it from a copy."
            ) from error


def _hello(line: str) -> Hello:
    for message in Decoder().feed(line.encode(), 0):
        if isinstance(message, Hello):
            return message
    raise ValueError("it says no device")


def _whole(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError("it has no number")
    return value
