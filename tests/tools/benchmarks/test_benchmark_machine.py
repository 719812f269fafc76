"""What is said of the machine: figures of the right order, whatever the machine."""

from tools.benchmarks import machine


def test_the_instruction_set_is_a_known_one():
    assert machine.isa() in {name for _, name in machine._ISAS} | {"generic"}


def test_the_widest_instruction_set_is_named(monkeypatch):
    def with_features(*names):
        monkeypatch.setattr(machine.llvm, "get_host_cpu_features", lambda: dict.fromkeys(names, True))
        return machine.isa()

    assert with_features("sse4.2", "avx", "avx2", "avx512f") == "avx512"
    assert with_features("sse4.2", "avx", "avx2") == "avx2"
    assert with_features("neon") == "neon"
    assert with_features() == "generic"


def test_peaks_are_of_this_world():
    assert 1e7 < machine.fma_rate_per_s() < 1e11
    assert 1e8 < machine.bandwidth_bytes_per_s() < 1e13
