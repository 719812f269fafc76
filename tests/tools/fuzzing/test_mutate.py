"""What becomes of an input is found out, also where the reader dies of it."""

from __future__ import annotations

import importlib
import json
import time
from pathlib import Path
from random import Random

import pytest

from r2sego_blender.captures.poses.registry import FORMATS as POSES
from r2sego_blender.captures.poses.registry import find_poses
from r2sego_blender.core.images import SUFFIXES
from r2sego_blender.splats.formats.registry import SUFFIXES as SPLAT_SUFFIXES
from tools.fuzzing.child import RIGHT, Reader, processor_s
from tools.fuzzing.children import Child
from tools.fuzzing.formats import HARNESSES
from tools.fuzzing.harness import CHANGES
from tools.fuzzing.mutate import Tally, mutate, planned, table
from tools.fuzzing.mutations.text import changed_text
from tools.fuzzing.mutations.xml import changed_xml

WRONG_WAYS = importlib.import_module("tests.tools.fuzzing.misbehaving").WRONG_WAYS
MISBEHAVING = "tests.tools.fuzzing.misbehaving"
FOUND = (
    "clean",
    "clean",
    "refused",
    "traceback",
    "death",
    "hang",
    "memory",
    "slow",
    "badaccept",
    "escape",
    "message",
    "message",
)


@pytest.mark.parametrize("content", [b"7 " * 30_000, b'<a b="' + b"7 " * 30_000 + b'"/>'], ids=["text", "xml"])
@pytest.mark.parametrize("change", [changed_text, changed_xml])
def test_what_is_changed_again_and_again_stays_of_a_size_to_be_held(content, change):
    for seed in range(60):
        assert len(change(content, Random(seed))[0]) < 32 << 20


def test_every_way_to_fail_is_told_of_its_own_input():
    with Child(0, MISBEHAVING, hang_s=4.0) as child:
        told = [(one, file.read_text()) for one, file in child.outcomes("misbehaving", 0, len(FOUND))]
    outcomes = [outcome for outcome, _ in told]
    assert [held for one, held in told if one["class"] not in RIGHT] == list(WRONG_WAYS)
    assert [one["number"] for one in outcomes] == list(range(len(FOUND)))
    assert tuple(one["class"] for one in outcomes) == FOUND
    assert outcomes[FOUND.index("memory")]["mb"] > 250 and outcomes[FOUND.index("slow")]["s"] > 1.0


def test_by_the_processors_clock_a_reader_that_waits_is_not_slow(tmp_path):
    """As of a guided search, to which other work leaves little of the machine."""
    harness = importlib.import_module(MISBEHAVING).HARNESSES[0]
    for number, (clock, kind) in enumerate([(processor_s, "refused"), (time.perf_counter, "slow")]):
        reader = Reader(tmp_path / str(number), clock)
        (reader.place(harness) / harness.file).write_text("slow")
        assert reader.outcome(harness)["class"] == kind


@pytest.mark.parametrize("harness", HARNESSES, ids=lambda harness: harness.name)
def test_the_same_seed_makes_the_same_inputs_and_they_differ(harness, right_inputs):
    data = (right_inputs.place(harness) / harness.file).read_bytes()
    first, again, other = ([harness.changed(data, seed, number)[0] for number in range(12)] for seed in (7, 7, 8))
    assert first == again and first != other
    assert len(set(first)) > 6


def test_every_kind_of_file_is_changed_somewhere():
    assert {one.kind for one in HARNESSES} == set(CHANGES)
    assert len({one.name for one in HARNESSES}) == len(HARNESSES)


def _kinds_of_poses(folder):
    """What the files that the harnesses write are read as."""
    for number, one in enumerate(HARNESSES):
        place = folder / str(number)
        if one.name.startswith("poses/") and one.file.startswith("poses/"):
            place.mkdir()
            one.build(place)
            yield find_poses(place / "poses")[0].name


def test_every_registered_format_of_splats_and_poses_is_tried(tmp_path):
    files = {one.name: Path(one.file) for one in HARNESSES}
    splats = {place.suffix for name, place in files.items() if name.startswith("splats/")}
    assert splats | {".usd"} >= set(SPLAT_SUFFIXES)  # .usda or .usdc by another name
    assert {record.name for record in POSES} == set(_kinds_of_poses(tmp_path))
    pictures = {place.suffix for name, place in files.items() if name.startswith("pictures/")}
    assert pictures | {".jpeg", ".tiff", ".heif"} >= SUFFIXES  # the same by other names


def test_the_count_is_shared_out_and_every_format_has_its_part():
    parts = planned(3000, HARNESSES)
    assert {one.name for one, *_ in parts} == {one.name for one in HARNESSES}
    assert abs(sum(after - first for _, first, after in parts) - 3000) < len(HARNESSES)


def test_a_run_goes_on_where_it_was_ended_and_keeps_the_smallest_of_each_failure(tmp_path):
    formats = [one for one in HARNESSES if one.name == "bundle/journal.jsonl"]
    whole = mutate(60, 3, formats, tmp_path, 1, again=False)
    assert sum(counts.total() for counts in whole.counts.values()) == 60
    log = tmp_path / "parts.jsonl"
    told = log.read_text()
    again = mutate(60, 3, formats, tmp_path, 1, again=True)
    assert log.read_text() == told  # nothing was tried anew
    assert again.counts == whole.counts and table(again).splitlines()[-1].split()[:2] == ["all", "60"]


def test_failures_of_one_cause_are_one(tmp_path):
    tally = Tally()
    one = {"number": 1, "class": "traceback", "text": "KeyError: 'a' @ a.py:3", "bytes": 9, "s": 0.1, "mb": 0}
    assert tally.add("x", one | {"change": ""})
    assert not tally.add("x", one | {"bytes": 12, "change": "", "text": "KeyError: 'bc' @ a.py:3"})
    assert tally.add("x", one | {"bytes": 2, "change": ""})
    assert [(kept["bytes"], kept["count"]) for kept in tally.failures.values()] == [(2, 3)]
    assert tally.failed == 3 and json.dumps(tally.failures) and RIGHT == ("refused", "clean")
