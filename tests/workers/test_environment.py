"""An environment is made from a folder of wheels, without a network."""

import base64
import hashlib
import subprocess
import zipfile

import pytest

from r2sego_blender.errors import MachineError
from r2sego_blender.progress import Progress
from r2sego_blender.workers.environment import make_environment, required_packages


class Told(Progress):
    """Remembers the messages."""

    def __init__(self):
        self.lines = []

    def message(self, text, level="info"):
        self.lines.append(text)


def write_wheel(folder):
    """A package ``tinything`` 1.0 of one module."""
    info = "tinything-1.0.dist-info"
    files = {
        "tinything.py": "ANSWER = 42\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: tinything\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    rows = []
    for name, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
        rows.append(f"{name},sha256={digest},{len(text)}")
    files[f"{info}/RECORD"] = "\n".join([*rows, f"{info}/RECORD,,"]) + "\n"
    with zipfile.ZipFile(folder / "tinything-1.0-py3-none-any.whl", "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)


@pytest.mark.slow
def test_wheels_are_installed_and_a_missing_one_is_named(tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    write_wheel(wheels)
    told = Told()
    python = make_environment(tmp_path / "engine", ["tinything==1.0"], wheels, told)
    answer = subprocess.run(
        [python, "-c", "import tinything; print(tinything.ANSWER)"], capture_output=True, text=True
    )
    assert answer.stdout.strip() == "42"
    assert any(line.startswith("Installing") for line in told.lines)
    with pytest.raises(MachineError, match="missingthing"):
        make_environment(tmp_path / "engine", ["missingthing"], wheels, told)


def test_the_requirements_are_the_projects_own():
    names = {line.partition("=")[0].rstrip("<>") for line in required_packages()}
    assert {"numpy", "torch", "mujoco", "pycolmap"} <= names


def test_a_missing_list_is_an_error_with_its_place(tmp_path):
    with pytest.raises(MachineError, match=r"pyproject\.toml"):
        required_packages(tmp_path / "pyproject.toml")
