"""Calibrating by known weights finds the simulated cells; what cannot be calibrated is refused."""

import numpy as np
import pytest

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.line.adapters import AsciiStream
from r2sego_blender.trials.line.calibrating import calibrate
from r2sego_blender.trials.line.decoding import Sample, StreamBuilder
from r2sego_blender.trials.line.listening import listen
from r2sego_blender.trials.line.simulated import DEVICE, simulated_calibration, simulated_device
from r2sego_blender.trials.stream import Channel, Hello

TRUE = simulated_calibration()
CHANNELS = tuple(one.channel for one in TRUE.channels)


def bench(loads, flags=0, count=50, device=DEVICE):
    """Gives the device under each of the loads (kg at tether, kg on the seat) in turn."""
    turns, said = iter(loads), []

    def measure(words):
        said.append(words)
        hello = Hello(1, device, "1.0", 1, 80.0, CHANNELS)
        builder = StreamBuilder(hello)
        newtons = 9.80665 * np.array(next(turns))
        raw = [round(c.zero + c.counts_per_newton * load) for c, load in zip(TRUE.channels, newtons, strict=True)]
        builder.add([Sample(n, 12_500 * n, tuple(raw), flags, n) for n in range(count)], 0)
        return hello, builder.stream()

    return measure, said


def test_known_weights_find_the_cells():
    measure, said = bench([(0, 0), (5, 0), (0, 10), (0, 20)])
    found = calibrate([("tether", 5.0), ("seat", 10.0), ("seat", 20.0)], measure)
    for one, true in zip(found.channels, TRUE.channels, strict=True):
        assert one.counts_per_newton == pytest.approx(true.counts_per_newton, rel=1e-4)
        assert one.zero == pytest.approx(true.zero, abs=1.0) and max(map(abs, one.residuals_n)) < 0.01
    assert len(said) == 4 and "5 kg on tether" in said[1] and "20 kg on seat" in said[3]
    assert (found.device, [len(one.points) for one in found.channels]) == (DEVICE, [2, 3])


@pytest.mark.parametrize(
    "weights", [[("tether", 5.0)], [("tether", 5.0), ("foot", 5.0)], [("tether", 0.0), ("seat", 5.0)]]
)
def test_weights_that_do_not_fit_are_refused_before_any_is_put_on(weights):
    measure, said = bench([(0, 0)])
    with pytest.raises(TrialError):
        calibrate(weights, measure)
    assert len(said) == 1


@pytest.mark.parametrize("options", [{"flags": 2}, {"flags": 4}, {"count": 5}])
def test_signals_that_tell_nothing_are_refused(options):
    measure, _ = bench([(0, 0)], **options)
    with pytest.raises(TrialError):
        calibrate([("tether", 5.0), ("seat", 5.0)], measure)


def test_weights_on_the_other_cell_are_noticed():
    measure, _ = bench([(0, 0), (0, 5), (5, 0)])
    with pytest.raises(TrialError, match="tether"):
        calibrate([("tether", 5.0), ("seat", 5.0)], measure)


def test_a_device_is_calibrated_over_its_line():
    device = simulated_device("unloaded", 3, 200, speed=2.0)
    scripts = iter(["unloaded", "weights:10:0", "weights:0:20"])
    with device as url:

        def measure(words):
            device.play(next(scripts), 3)
            return listen(url, AsciiStream(), seconds=0.3)

        found = calibrate([("tether", 10.0), ("seat", 20.0)], measure)
    newtons = found.newtons(np.array([[84210 + 812 * 100, -21340 + 640 * 300]]))
    np.testing.assert_allclose(newtons, [[100.0, 300.0]], atol=0.5)
    assert found.channels[0].channel == Channel("tether", -(1 << 23), (1 << 23) - 1)
