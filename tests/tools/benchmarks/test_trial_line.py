"""A minute at 1 kHz comes into the record whole and costs little; killed recorders leave what they had."""

import sys

import pytest

from tools.benchmarks.trial_line import killed_recorders, recorded_load

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="measured as Linux tells it, over its terminals"),
]


def test_a_minute_at_a_kilohertz_loses_nothing_and_takes_a_twentieth_of_a_core(tmp_path):
    for number in range(3):  # a machine that is busy otherwise may take the time away for once
        load = recorded_load(tmp_path / f"load_{number}", 60.0)
        if not load.lost:
            break
    assert load.samples >= 59_000 and load.lost == 0 and load.resets == 0
    assert load.share <= 0.05


def test_a_killed_recorder_leaves_all_up_to_its_last_chunk(tmp_path):
    # as slow that a busy machine's terminal does not overflow: what the line lost the recorder cannot leave
    runs = killed_recorders(tmp_path / "kills", 5, seed=39, rate_hz=300)
    assert [run.problem for run in runs] == [""] * 5
    assert max(run.read_bytes for run in runs) > 10_000
