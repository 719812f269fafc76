"""onnxruntime tells nobody anything: no file in the home or cache folder, and no address reached for."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from network_watch import reached, reached_in, watched

ROOT = Path(__file__).parents[3]
HOME = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "USERPROFILE", "LOCALAPPDATA", "APPDATA")
# Its first telemetry is sent within a few seconds.
LINGER = "; import time; time.sleep(4)"


def environment(home):
    # CI switches telemetry off by itself, which would hide that nothing else does.
    kept = {key: value for key, value in os.environ.items() if key not in ("CI", "ORT_DISABLE_TELEMETRY")}
    return kept | dict.fromkeys(HOME, str(home)) | {"PYTHONPATH": str(ROOT)}


@pytest.fixture
def home(tmp_path):
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


QUIET = "from r2sego_blender.robot.controllers.telemetry import onnxruntime_without_telemetry as o; o()"


def test_nothing_is_kept_and_nobody_is_told(tmp_path, home):
    command = [sys.executable, "-c", f"{QUIET}{LINGER}"]
    assert reached(command, tmp_path / "log", env=environment(home)) == []
    assert list(home.rglob("*")) == []


def test_an_import_by_itself_keeps_an_identifier(home):
    """What the switch is for; once this fails, a later onnxruntime needs none."""
    subprocess.run([sys.executable, "-c", "import onnxruntime"], env=environment(home), check=True)
    assert [path.name for path in home.rglob("deviceid")] == ["deviceid"]


def test_onnxruntime_is_imported_in_one_place():
    places = [*(ROOT / "r2sego_blender").rglob("*.py")]
    places += [file for name in ("operators", "panels", "batch", "tools") for file in (ROOT / name).rglob("*.py")]
    found = set()
    for file in places:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            named = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.split(".")[0] == "onnxruntime" for name in named):
                found.add(file.name)
    assert found == {"telemetry.py"}


TALKS = """
import socket, subprocess, sys
def attempt(family, address):
    with socket.socket(family, socket.SOCK_DGRAM) as one:
        one.settimeout(1)
        try:
            one.connect(address)
        except OSError:
            pass
attempt(socket.AF_INET, ("127.0.0.1", 9))
attempt(socket.AF_INET, ("192.0.2.1", 9))
attempt(socket.AF_INET6, ("::1", 9))
attempt(socket.AF_INET6, ("2001:db8::1", 9))
"""


def test_the_watch_sees_what_a_command_and_its_children_reach_for(tmp_path):
    child = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]], check=True)"
    done, found = watched([sys.executable, "-c", child, TALKS], tmp_path / "log")
    assert done.returncode == 0
    assert [(one.call, one.address) for one in found] == [("connect", "192.0.2.1:9"), ("connect", "2001:db8::1:9")]


def test_the_watch_sees_names_looked_up():
    lines = [
        '7 connect(3, {sa_family=AF_INET, sin_port=htons(53), sin_addr=inet_addr("127.0.0.53")}, 16) = 0',
        '7 sendto(3, "x", 1, 0, {sa_family=AF_INET, sin_port=htons(53), sin_addr=inet_addr("10.0.0.1")}, 16) = 1',
        '7 connect(3, {sa_family=AF_UNIX, sun_path="/var/run/nscd/socket"}, 110) = 0',
        '7 connect(3, {sa_family=AF_UNIX, sun_path="/var/run/nscd/socket"}, 110) = -1 ENOENT',
        '7 connect(3, {sa_family=AF_UNIX, sun_path="/tmp/own"}, 110) = 0',
        "7 sendto(3, [{nlmsg_len=20}], 20, 0, {sa_family=AF_NETLINK, nl_pid=0, nl_groups=00000000}, 12) = 20",
        '7 connect(3, {sa_family=AF_INET6, sin6_port=htons(9), inet_pton(AF_INET6, "::ffff:127.0.0.1", &x)}, 28) = 0',
    ]
    assert [one.is_lookup for one in reached_in("\n".join(lines))] == [True, True, True]
