"""Every operator is shown by an example script, with properties it has; the page that says so is true."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tools.pages.scripts import calls, operators, scripts_page

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def registered(blender_environment):
    """The operators that the add-on registers, each with the names of its properties."""
    script = ROOT / "batch" / "examples" / "press_buttons.py"
    done = subprocess.run(
        [sys.executable, str(script), "--", "--list"], env=blender_environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    lines = re.findall(r"^(\w+)\((.*?)\): ", done.stdout, re.MULTILINE)
    return {name: set(properties.split(", ")) for name, properties in lines}


def test_every_operator_is_called_by_a_script(registered):
    assert len(registered) >= 80
    assert set(registered) - {call.operator for call in calls()} == set()


def test_scripts_call_operators_that_are_there_with_properties_they_have(registered):
    for call in calls():
        assert call.operator in registered, call
        assert set(call.properties) <= registered[call.operator], call


def test_every_script_is_tested():
    tests = "\n".join(file.read_text() for file in (ROOT / "tests").rglob("test_*.py"))
    scripts = [file.name for file in (ROOT / "batch" / "examples").glob("*.py")]
    assert len(scripts) > 15
    shared = {"enabled_addon.py", "capture_lasso.py"}
    assert [name for name in scripts if name not in shared and name not in tests] == []


def test_the_page_is_made_from_the_operators_and_the_scripts(registered):
    assert {one.name for one in operators()} == set(registered)
    made = scripts_page()
    assert made.count("`r2sego ") > 30
    for command, operator in (("objects", "decide_prior"), ("robot", "region_from_object")):
        assert re.search(rf"\| `{operator}` \|.*\| `r2sego {command}` \|", made)
    on_disk = (ROOT / "docs" / "blender" / "scripts.md").read_text(encoding="utf-8")
    assert on_disk == made, "run `python -m tools.pages.scripts`"
