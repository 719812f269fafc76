"""Policies of strangers: refused in a sentence, in moments, and nothing else on the machine is touched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import hostile_policies as hostile
import numpy as np
import pytest
from tiny_policies import counting_policy, onnx_policy, torchscript_policy, trusted

from r2sego_blender.config.trusted_programs import Program, trust, withdraw
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.controllers.policy_layout import PolicyLayout
from r2sego_blender.robot.controllers.policy_runtime import PolicyFile
from r2sego_blender.robot.controllers.policy_trust import kept_rights, require_trusted
from r2sego_blender.workers.child import RUNNING, kill_children
from r2sego_blender.workers.processes import birth

ROOT = Path(__file__).parents[3]
KNEES = """
rate_hz = 50.0
step_s = 0.005
joints = [["left_knee_joint", 0.3, 150.0, 4.0], ["right_knee_joint", 0.2, 150.0, 4.0]]
observation = [{ term = "joint_pos_rel" }, { term = "velocity_command" }]
[action]
scale = 0.5
[commands]
vx_m_s = [-0.5, 1.0]
vy_m_s = [-0.3, 0.3]
yaw_rate_rad_s = [-1.0, 1.0]
"""
CONFINED = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux alone can take rights away here")


@pytest.fixture
def knees(tmp_path) -> PolicyLayout:
    (tmp_path / "knees.toml").write_text(KNEES)
    return PolicyLayout.load(tmp_path / "knees.toml")


def refused(path: Path, layout: PolicyLayout) -> str:
    with pytest.raises(RobotError) as raised:
        PolicyFile(path, layout)
    assert raised.value.where == str(path) and raised.value.cure
    return str(raised.value)


@pytest.mark.parametrize(
    "content",
    [
        hostile.constant_of_shape(hostile.HUGE),
        hostile.constant_of_shape(2**31),
        hostile.expanded(2**31),
        hostile.looping(hostile.HUGE),
        hostile.of_many_dimensions(),
        hostile.elsewhere(b"../../etc/passwd"),
        hostile.elsewhere(b"/etc/passwd", b"\n\x88\x80\x00location"),
        hostile.elsewhere(b"/etc/passwd", b"\x8a\x80\x00\x08location"),
        hostile.elsewhere(b"*/_ORT_MEM_ADDR_/*"),
    ],
    ids=["2^62", "8 GB", "expanded", "loop", "dimensions", "passwords", "long", "longer", "memory"],
)
def test_a_graph_that_wants_all_is_refused_in_moments(tmp_path, knees, content):
    path = tmp_path / "greedy.onnx"
    path.write_bytes(content)
    began, children = time.process_time(), os.times()
    refused(path, knees)
    ended = os.times()
    spent_s = time.process_time() - began + sum(ended[2:4]) - sum(children[2:4])
    assert spent_s < 1.5  # of the processor, with the process's start


def test_a_loop_that_ends_and_a_constant_that_fits_are_computed(tmp_path, knees):
    for content, bias in ((hostile.looping(3), 3.0), (hostile.constant_of_shape(1000), 0.0)):
        (tmp_path / "modest.onnx").write_bytes(content)
        observation = np.arange(5, dtype=np.float32)
        np.testing.assert_allclose(PolicyFile(tmp_path / "modest.onnx", knees).network()(observation), 10.0 + bias)


def test_a_program_runs_only_where_its_very_content_was_trusted(tmp_path, knees):
    marker = "print('it ran')"
    path = hostile.torchscript(tmp_path / "policy.pt", marker)
    program = Program.of(path.name, path.read_bytes())
    said = refused(path, knees)
    assert program.sha256 in said and f"r2sego trust {path}" in said
    with pytest.raises(RobotError, match=program.sha256):
        require_trusted(str(path))
    trust(program)
    require_trusted(str(path))
    PolicyFile(path, knees)
    path.write_bytes(path.read_bytes() + b" ")
    refused(path, knees)
    path.write_bytes(path.read_bytes()[:-1])
    withdraw(program.sha256)
    refused(path, knees)


def test_a_damaged_program_ends_its_own_process_alone(tmp_path, knees):
    path = torchscript_policy(tmp_path / "cut.pt", np.zeros((5, 2)), np.zeros(2))
    whole = path.read_bytes()
    rng, damaged = np.random.default_rng(7), [hostile.damaged_storage(whole)]
    for _ in range(2):
        noisy = bytearray(whole)
        for place in rng.integers(len(noisy), size=200):
            noisy[place] = rng.integers(256)
        damaged.append(bytes(noisy))
    for content in damaged:
        path.write_bytes(content)
        try:  # torch reads behind the end of what was cut off: numbers, or the end of its process
            PolicyFile(trusted(path), knees)
        except RobotError as error:
            assert error.where == str(path)


@CONFINED
def test_a_trusted_program_writes_no_file_and_reads_none(tmp_path, knees):
    secret = tmp_path / "secret"
    secret.write_bytes(bytes(64))
    if "writing files" in kept_rights():
        pytest.skip("this system cannot take writing away")
    places = {
        "saved": f'torch.save(x, "{tmp_path}/saved")',
        "mapped": f'x = x + torch.from_file("{tmp_path}/mapped", True, 10).sum()',
        "read": f'x = x + torch.from_file("{secret}", False, 10).sum()',
    }
    for name, body in places.items():
        policy = trusted(hostile.torchscript(tmp_path / f"{name}.pt", body))
        if name == "saved":  # torch passes over what it may not write
            PolicyFile(policy, knees)
        else:
            refused(policy, knees)
    assert {file.name for file in tmp_path.iterdir()} == {"knees.toml", "secret", *(f"{name}.pt" for name in places)}


@pytest.mark.parametrize("body", ["x = torch.zeros(10000000000)[None, :5]", "while True:\n        x = x + 1"])
def test_a_trusted_program_has_bounds_too(tmp_path, knees, body):
    refused(trusted(hostile.torchscript(tmp_path / "greedy.pt", body)), knees)


def test_networks_of_one_process_do_not_share_what_they_remember(tmp_path, knees):
    file = PolicyFile(trusted(counting_policy(tmp_path / "counting.pt")), knees)
    one, other = file.network(), file.network()
    seen = [float(network(np.zeros(5, np.float32))[0]) for network in (one, one, other, one, other)]
    assert seen == [1.0, 2.0, 1.0, 3.0, 2.0]


def test_the_process_goes_with_its_policy_and_with_a_cancelled_command(tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    before = set(RUNNING)
    file = PolicyFile(policy, knees)
    (process,) = set(RUNNING) - before
    assert process.poll() is None
    del file
    assert process.poll() is not None and process not in RUNNING
    network = PolicyFile(policy, knees).network()
    began = time.monotonic()
    kill_children()
    with pytest.raises(Exception, match="ended"):
        network(np.zeros(5, np.float32))
    assert time.monotonic() - began < 2.0


HOLDS = """
import sys
from r2sego_blender.robot.controllers.policy_layout import PolicyLayout
from r2sego_blender.robot.controllers.policy_runtime import PolicyFile
from r2sego_blender.workers.child import RUNNING
file = PolicyFile(sys.argv[1], PolicyLayout.load(sys.argv[2]))
print(*(process.pid for process in RUNNING), flush=True)
input()
"""


@CONFINED
def test_the_process_ends_with_a_killed_parent(tmp_path, knees):
    policy = onnx_policy(tmp_path / "p.onnx", np.zeros((5, 2)), np.zeros(2))
    command = [sys.executable, "-c", HOLDS, str(policy), knees.where]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)}
    ) as parent:
        pid = int(parent.stdout.readline())
        assert birth(pid)
        parent.send_signal(signal.SIGKILL)
    limit = time.monotonic() + 2.0
    while birth(pid) and time.monotonic() < limit:
        time.sleep(0.02)
    assert not birth(pid)
