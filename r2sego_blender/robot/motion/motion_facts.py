"""What a recorded motion's file says, for people: how long it is, at which rate, and what of it is not used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .recorded_motion import HumanRecording, read_recording

_NAMED = 4


def motion_facts(path: str | Path) -> dict[str, Any]:
    """Of the motion at ``path``, JSON-ready: its name, seconds, rate in Hz and the field that says it.

    The field is '' where the rate is assumed. ``base`` is what is known of the base: "path and turn",
    "path", "turn" or ""; ``unread`` are fields that are not used. Raises RobotError as ``read_recording``.
    """
    recording = read_recording(path)
    known = ["path", "turn"]
    if not isinstance(recording, HumanRecording) and recording.bodies is None:
        known = ["path"] * (recording.root_m is not None) + ["turn"] * (recording.quaternion is not None)
    return {
        "motion": Path(path).name,
        "seconds": recording.seconds,
        "rate_hz": recording.rate_hz,
        "rate_field": recording.rate_field,
        "base": " and ".join(known),
        "unread": list(recording.unread),
    }


def motion_line(facts: dict[str, Any]) -> str:
    """What ``motion_facts`` says, for a person."""
    rate = facts["rate_field"] or "assumed: it declares none"
    text = f"motion: {facts['motion']}: {facts['seconds']:.2f} s at {facts['rate_hz']:g} Hz ({rate})"
    if facts["base"] != "path and turn":
        text += f"; of its base {facts['base'] or 'nothing'} is recorded"
    if unread := facts["unread"]:
        more = f" and {len(unread) - _NAMED} more" if len(unread) > _NAMED else ""
        text += f"; not used: {', '.join(unread[:_NAMED])}{more}"
    return text
