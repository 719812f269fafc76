"""What is said of the machine: figures of the right order, whatever the machine."""

from r2sego_blender.benchmarks import machine


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


def test_the_processor_has_a_name():
    assert machine.processor().strip()


def test_memory_and_time_only_grow():
    before_s = machine.cpu_s()
    block = bytearray(32 << 20)
    peak_mb = machine.peak_memory_mb()
    assert peak_mb is None or peak_mb > 32
    del block
    assert machine.peak_memory_mb() == peak_mb
    assert machine.cpu_s() >= before_s


def test_the_peak_of_memory_can_begin_anew():
    machine.forget_peak_memory()
    before_mb = machine.peak_memory_mb()
    if before_mb is None:
        return
    block = bytearray(64 << 20)
    block[::4096] = b"x" * len(block[::4096])
    assert machine.peak_memory_mb() > before_mb + 32
