"""A program of another environment gets this library by its place and no other package of this environment."""

import importlib.util
import json
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender.results import backends
from r2sego_blender.workers import library_path
from r2sego_blender.workers.engine import engine_environment


@pytest.fixture
def under_pip(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """This library as pip installs it, beside a package that another environment has too: that
    folder, and the other environment's python."""
    packages, others = tmp_path / "site-packages", tmp_path / "other"
    for folder, words in ((packages, "of the engine"), (others, "of the model")):
        (folder / "model_weights").mkdir(parents=True)
        (folder / "model_weights" / "__init__.py").write_text(f"whose = {words!r}\n")
    shutil.copytree(library_path.LIBRARY, packages / "r2sego_blender", ignore=shutil.ignore_patterns("__pycache__"))
    (packages / "r2sego_blender" / "workers" / "told_program.py").write_text(
        "import sys\n"
        "from .protocol.serving import Answer, serve\n"
        "def tell(request, progress):\n"
        "    import model_weights\n"
        "    from .. import __file__ as place\n"
        "    return Answer('told', '', {}, {'whose': model_weights.whose, 'place': place, 'path': sys.path})\n"
        "def main(word):\n"
        "    assert word == 'a word'\n"
        "    serve({'told': tell})\n"
    )
    numpy = Path(importlib.util.find_spec("numpy").origin).parents[1]
    (others / "numpy").symlink_to(numpy / "numpy")
    for libraries in numpy.glob("numpy.libs"):
        (others / "numpy.libs").symlink_to(libraries)
    python = tmp_path / "python"
    python.write_text(
        f'#!/bin/sh\nPYTHONPATH="${{PYTHONPATH:+$PYTHONPATH:}}{others}" exec "{sys.executable}" -S "$@"\n'
    )  # -S: an interpreter that has not this one's packages
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    return packages, python


ASK = """
import json, sys
from r2sego_blender.workers.protocol.asking import ask
from r2sego_blender.workers.protocol.program_worker import ProgramWorker, library_command
from r2sego_blender.workers.protocol.request import Request
command = library_command(sys.argv[1], "workers.told_program", "a word")
with ProgramWorker(command, "here", "") as worker, ask(worker, Request("told")) as response:
    print(json.dumps(dict(response.values)))
"""


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands for the environment")
@pytest.mark.parametrize("started_by", ["pip", "the add-on"])
def test_another_environment_gets_this_package_and_no_other(under_pip, tmp_path, monkeypatch, started_by):
    packages, python = under_pip
    monkeypatch.setenv("PYTHONPATH", str(packages))
    if started_by == "the add-on":
        monkeypatch.setenv("PYTHONSAFEPATH", "1")
    (tmp_path / "here" / "model_weights").mkdir(parents=True)  # where the person stands
    (tmp_path / "here" / "model_weights" / "__init__.py").write_text("whose = 'nobody'\n")
    done = subprocess.run([sys.executable, "-c", ASK, python], capture_output=True, text=True, cwd=tmp_path / "here")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["whose"] == "of the model"
    assert Path(answer["place"]).parent == packages / "r2sego_blender"
    assert str(packages) not in answer["path"] and str(tmp_path / "here") not in answer["path"]


def test_external_programs_keep_what_the_person_put_on_the_path(monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("R2SEGO_TEST", "kept")
    assert engine_environment()["PYTHONPATH"].split(os.pathsep)[0] == str(library_path.LIBRARY.parent)
    monkeypatch.setenv("PYTHONPATH", engine_environment()["PYTHONPATH"])
    environment = library_path.external_variables()
    assert (environment["PYTHONPATH"], environment["R2SEGO_TEST"]) == (str(tmp_path), "kept")
    monkeypatch.setenv("PYTHONPATH", str(library_path.LIBRARY.parent))
    assert "PYTHONPATH" not in library_path.external_variables()


def test_external_programs_find_modules_beside_themselves(monkeypatch):
    monkeypatch.setenv("PYTHONSAFEPATH", "")
    library_path.leave_working_folder_unsearched()
    assert os.environ["PYTHONSAFEPATH"]
    assert "PYTHONSAFEPATH" not in library_path.external_variables()
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # the person's own word
    library_path.leave_working_folder_unsearched()
    assert library_path.external_variables()["PYTHONSAFEPATH"] == "1"


@pytest.mark.parametrize("words", [library_path.IMPORT_LIBRARY, backends._FIND], ids=["import", "find"])
def test_another_python_runs_no_module_of_the_working_folder(tmp_path, words):
    for name in ("importlib", "json", "sys"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(7)\n")
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    command = [sys.executable, "-S", "-c", words, "json"]  # -S: else the site's own files may have loaded importlib
    assert subprocess.run(command, cwd=tmp_path, env=variables, stdout=subprocess.DEVNULL).returncode == 0
