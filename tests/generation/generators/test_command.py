"""The program that a person names: its words, its size, and what it is known by."""

import json
import stat
import sys

import pytest

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.errors import MachineError
from r2sego_blender.generation.generators import command as generator_command
from r2sego_blender.generation.generators.command import COMMAND_VARIABLE, SIZE_VARIABLE, installation


@pytest.fixture
def named(monkeypatch):
    """What is found when the environment names this program and this size."""

    def installed(command="", size=""):
        monkeypatch.setenv(COMMAND_VARIABLE, command)
        monkeypatch.setenv(SIZE_VARIABLE, size)
        return installation("command", GenerationSettings())

    return installed


def test_the_environment_names_program_and_size(tmp_path, named):
    with pytest.raises(MachineError, match=r"no generator is named\. Set R2SEGO_GENERATOR"):
        named()
    found = named(f"'{sys.executable}' 'my generator.py' --fast")
    assert (found.command, found.size) == ((sys.executable, "my generator.py", "--fast"), None)
    alone = tmp_path / "my generator"
    alone.write_text("#!/bin/sh\n")
    alone.chmod(alone.stat().st_mode | stat.S_IXUSR)
    assert named(str(alone)).command == (str(alone),)
    long = f"{sys.executable} -c '{'pass;' * 100}'"
    assert named(long).command == (sys.executable, "-c", "pass;" * 100)
    with pytest.raises(MachineError, match="no-such-program: the program in R2SEGO_GENERATOR is not there"):
        named("no-such-program here")
    with pytest.raises(MachineError, match="is no command"):
        named("'half")
    assert named(long, "1024x576").size == (1024, 576)
    for wrong in ("1024", "0x576", "ax3", "-4x5"):
        with pytest.raises(MachineError, match="R2SEGO_GENERATOR_SIZE is no size"):
            named(long, wrong)


def test_another_program_is_another_identity(tmp_path, named):
    """What is run, its size and every file among its words count; where they lie does not."""
    script, weights, own = (tmp_path / name for name in ("my generator.py", "weights.bin", "generator.sh"))
    for file in (script, weights, own):
        file.write_text("#!/bin/sh\n")
    own.chmod(own.stat().st_mode | stat.S_IXUSR)
    command = f"{sys.executable} '{script}'"
    known = {}

    def told(*words):
        identity = named(*words).identity
        assert identity == named(*words).identity == json.loads(json.dumps(identity))
        return known.setdefault(json.dumps(identity), words)

    different = [
        (command,),
        (command, "1024x576"),
        (f"{command} --fast",),
        (f"{command} {weights}",),
        (str(own),),
        (f"{own} {weights}",),
    ]
    assert [told(*words) for words in different] == different
    for file, words in ((script, (command,)), (weights, (f"{command} {weights}",)), (own, (str(own),))):
        file.write_text("#!/bin/sh\n# mended\n")
        assert json.dumps(named(*words).identity) not in known
        file.write_text("#!/bin/sh\n")
    (tmp_path / "moved").mkdir()
    moved = script.rename(tmp_path / "moved" / script.name)
    assert told(f"{sys.executable} '{moved}'") == (command,)


def test_weights_that_may_not_be_read_are_told_by_their_name(tmp_path, named, monkeypatch):
    def refused(path):
        raise PermissionError(13, "Permission denied", str(path))

    (tmp_path / "weights.bin").write_bytes(b"1")
    monkeypatch.setattr(generator_command, "file_identity", refused)
    words = named(f"{sys.executable} {tmp_path / 'weights.bin'}").identity["command"]
    assert words == [sys.executable, str(tmp_path / "weights.bin")]
