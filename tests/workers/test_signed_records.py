"""A record is one only where it was signed, with the secret of this user."""

import json
import os
import shutil
import stat
from concurrent.futures import ThreadPoolExecutor

import pytest

from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.signed_records import read_record, read_signed, write_signed

RECORD = {"command": ["python", "-m", "ü"], "started": 1764156155.25, "notes": {"b": [1, 2.5, None], "a": True}}


@pytest.fixture(autouse=True)
def configuration(tmp_path, monkeypatch):
    monkeypatch.setenv("R2SEGO_CONFIG", str(tmp_path / "configuration"))
    return tmp_path / "configuration"


@pytest.fixture
def file(tmp_path):
    (tmp_path / "job").mkdir()
    return tmp_path / "job" / "job.json"


def test_what_was_signed_is_read_and_its_secret_is_the_users_alone(file, configuration):
    write_signed(file, RECORD)
    assert read_signed(file) == RECORD
    (secret,) = configuration.iterdir()
    assert len(secret.read_bytes()) == 32
    if os.name != "nt":
        assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    kept = secret.read_bytes()
    write_signed(file, RECORD)
    assert secret.read_bytes() == kept


@pytest.mark.parametrize("change", [{"command": ["evil"]}, {"signature": "0" * 64}, {"signature": "é"}, {"more": 1}])
def test_what_was_changed_is_none(file, change):
    write_signed(file, RECORD)
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    assert read_signed(file) == {}


def test_unsigned_ones_and_those_of_another_secret_are_none(file, configuration):
    file.write_text(json.dumps(RECORD))
    assert read_signed(file) == {} and not configuration.exists()  # nothing is made by reading
    write_signed(file, RECORD)
    (configuration / "jobs.key").write_bytes(bytes(32))
    assert read_signed(file) == {}


def test_a_record_is_none_at_another_place(file, tmp_path):
    write_signed(file, RECORD)
    shutil.copytree(file.parent, tmp_path / "copy")
    assert read_signed(tmp_path / "copy" / "job.json") == {}
    shutil.copy(file, file.with_name("end.json"))
    assert read_signed(file.with_name("end.json")) == {}
    (tmp_path / "link").symlink_to(file.parent)
    assert read_signed(tmp_path / "link" / "job.json") == RECORD  # the same place by another name


@pytest.mark.parametrize(
    "text", ['{"started": NaN}', "[" * 5000, "{" * 40, '{"a": ' + "9" * 5000 + "}", '"' + "x" * (1 << 21) + '"', "[]"]
)
def test_bombs_and_nonsense_are_none(file, text):
    file.write_text(text)
    assert read_record(file) == {} and read_signed(file) == {}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_none_and_nobody_waits_for_it(file):
    os.mkfifo(file)
    assert read_record(file) == {} and read_signed(file) == {}


def test_one_secret_comes_of_many_first_uses(tmp_path):
    places = [tmp_path / str(index) for index in range(16)]
    for place in places:
        place.mkdir()
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(lambda place: write_signed(place / "job.json", RECORD), places))
    assert all(read_signed(place / "job.json") == RECORD for place in places)


def test_a_damaged_secret_is_made_anew(file, configuration):
    configuration.mkdir(parents=True)
    (configuration / "jobs.key").write_bytes(b"half")
    write_signed(file, RECORD)
    assert read_signed(file) == RECORD
    assert [path.name for path in configuration.iterdir()] == ["jobs.key"]


def test_a_secret_that_cannot_be_kept_is_told_with_a_cure(file, configuration):
    configuration.write_text("a file")
    with pytest.raises(MachineError, match=r"jobs\.key.*R2SEGO_CONFIG"):
        write_signed(file, RECORD)
