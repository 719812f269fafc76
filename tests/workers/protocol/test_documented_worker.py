"""The worker that docs/backends.md shows works as it stands, with a copy of ``serving`` beside it and NumPy alone."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.protocol import serving
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.http_worker import HttpWorker
from r2sego_blender.workers.protocol.program_worker import ProgramWorker
from r2sego_blender.workers.protocol.request import Request
from r2sego_blender.workers.protocol.response import RefusedRequestError

PAGE = Path(__file__).parents[3] / "docs" / "backends.md"
PHOTOGRAPHS = {f"photograph_{n:03d}": np.full((4, 6, 3), 51 * (n + 1), np.uint8) for n in range(2)}


@pytest.fixture
def script(tmp_path) -> Path:
    body = re.search(r"```python\n(from pathlib.*?)```", PAGE.read_text(encoding="utf-8"), re.S).group(1)
    (tmp_path / "worker.py").write_text(body)
    shutil.copy(serving.__file__, tmp_path)
    return tmp_path / "worker.py"


def check(worker, folder: Path) -> None:
    with pytest.raises(MachineError, match=r"the weights are not there\. Fetch them"), ask(worker, Request("depth")):
        pass
    weights = folder / "weights.npz"
    np.savez(weights, near=2.0)
    with ask(worker, Request("depth", inputs=PHOTOGRAPHS)) as response:
        assert (response.backend, response.weights) == ("My model 1.0", serving.file_digest(weights))
        for number in range(2):
            depth = response.array(f"depth_{number:03d}", (4, 6))
            np.testing.assert_allclose(depth, 2.0 + 0.2 * (number + 1), rtol=1e-6)
    black = Request("depth", inputs={"photograph_000": np.zeros((4, 6, 3), np.uint8)})
    with pytest.raises(RefusedRequestError, match="photograph_000 is black"), ask(worker, black):
        pass


def test_it_answers_as_a_program(script):
    with ProgramWorker([sys.executable, str(script)], "mine", "") as worker:
        check(worker, script.parent)


def test_it_answers_on_loopback(script, tmp_path):
    (tmp_path / "token").write_text("a token of this test")
    command = [sys.executable, str(script), "--http", "0", "--token-file", str(tmp_path / "token")]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        port = json.loads(server.stdout.readline())["port"]
        check(HttpWorker(f"http://127.0.0.1:{port}", "mine", "", tmp_path / "token"), script.parent)
    finally:
        server.kill()
        server.wait()
        server.stdout.close()
