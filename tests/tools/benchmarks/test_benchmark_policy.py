"""The bench of policies: an environment's own figures, of a made-up room and of a bundle."""

import json

import pytest

from r2sego_blender.core.errors import SettingsError
from tools.benchmarks import policy as bench


def test_a_made_up_room_is_stepped_and_seen():
    figures = json.loads(json.dumps(bench.bench_policy(gaussians=800, steps=3, processes=1)))
    assert figures["gaussians"] == 800 and figures["side_by_side"] is None
    step_ms = 1e3 / figures["steps_a_cpu_second"]
    assert 0.0 < figures["picture_ms"] < step_ms < 1000.0  # a picture is a part of a step
    assert figures["heads"]["size"] == "64x64" and figures["heads"]["pictures_a_cpu_second"] > 10.0
    assert any("800 Gaussians" in line for line in bench.lines(figures))


def test_numbers_below_one_are_told():
    with pytest.raises(SettingsError):
        bench.bench_policy(steps=0)
