"""What counts as a success, and when a recording tells nothing (Sec. "Real-Robot Sitting Validation")."""

from __future__ import annotations

from dataclasses import dataclass

from ...config.fields import setting

RERUNS = ("at_once", "at_end")


@dataclass(frozen=True)
class Rules:
    """Thresholds of a study, stated before its first trial.

    Loads are in newtons, of all channels of that name together: "seat", "seat_left", ... are one seat.
    """

    support_s: float = setting(3.0, "The chair carries the robot this long without a break.", 2.0, 60.0)
    seat_n: float = setting(100.0, "It carries the robot where the seat bears at least this, newtons.", 1.0, 5000.0)
    stability: float = setting(0.5, "The support's lowest load, as a share of its highest, is at least this.", 0.0, 1.0)
    tether_n: float = setting(30.0, "The tether bears load where it bears more than this, newtons.", 1.0, 5000.0)
    timeout_s: float = setting(60.0, "Within this time the support has to be complete.", 1.0, 600.0)
    max_gap_ms: float = setting(50.0, "Longest time between two samples, by the device's clock.", 1.0, 1000.0)
    max_loss: float = setting(0.001, "Largest share of samples that are missing.", 0.0, 0.1)
    max_drift: float = setting(0.01, "Largest deviation of the device's clock from the host's, as a share.", 1e-5, 0.1)
    max_silence_ms: float = setting(200.0, "Longest time without a sample, by the host's clock.", 1.0, 5000.0)
    calibration_days: float = setting(30.0, "A calibration older than this is out of date.", 0.01, 366.0)
    rerun: str = setting(
        "at_once", "When a trial with an unusable recording is run again: at once, or after all others.", choices=RERUNS
    )
