"""Behaviours are the modules of their folder: in a fixed order, and a new one is one file."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from r2sego_blender.config.fields import fields_of
from r2sego_blender.robot.behaviours.registry import BEHAVIOURS
from r2sego_blender.robot.scope.scope import Behaviours, BehaviourScope

LIBRARY = Path(__file__).parents[3] / "r2sego_blender"
WAVE = '''
from dataclasses import dataclass
from ...config.fields import Range, setting
from .behaviour import Behaviour


@dataclass(frozen=True)
class Wave:
    """Ranges of the wave."""

    height_m: Range = setting((0.2, 0.4), "How high the hand goes.", 0.0, 1.0)


BEHAVIOUR = Behaviour(Wave, "Stand and wave.", plan=lambda course: None, needs_legs=True)
'''
SAYS = """
import json, sys, tomllib
from pathlib import Path
from r2sego_blender.bundle.keys import _as_json
from r2sego_blender.robot.scope.scope import BehaviourScope
tables = tomllib.loads("behaviours.wave = 2\\nwave.height_m = [0, 1]")
scope = BehaviourScope.from_tables(tables, Path("a.toml"))
shipped = BehaviourScope.load("walk_and_look")
told = [scope.behaviours.wave, scope.wave.height_m, shipped.behaviours.wave, shipped, scope]
print(json.dumps(told, sort_keys=True, default=_as_json))
"""


def test_the_order_is_the_one_that_attempts_are_drawn_in():
    assert [one.name for one in BEHAVIOURS] == ["walk_to", "look_around", "step_around", "squat", "sit_on"]
    assert list(fields_of(Behaviours)) == [one.name for one in BEHAVIOURS]
    assert [one.name for one in BEHAVIOURS if one.needs_legs] == ["squat", "sit_on"]


def test_each_has_its_ranges_in_the_scope():
    for one in BEHAVIOURS:
        assert fields_of(BehaviourScope)[one.name].default == one.parameters()
        assert one.doc.endswith(".") and all(field.doc for field in fields_of(one.parameters).values())


def test_scopes_go_to_the_processes_that_simulate():
    scope = replace(BehaviourScope.load("sit_down"), behaviours=Behaviours(squat=1.0))
    assert pickle.loads(pickle.dumps(scope)) == scope


def test_a_new_behaviour_is_one_file_and_changes_no_key(tmp_path):
    copy = tmp_path / "r2sego_blender"
    for part in ("core", "config", "bundle", "robot/behaviours", "robot/scope", "robot/scopes"):
        shutil.copytree(LIBRARY / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
    for part in ("", "robot"):
        shutil.copy(LIBRARY / part / "__init__.py", copy / part)
    (copy / "robot" / "behaviours" / "wave.py").write_text(WAVE)
    done = subprocess.run(
        [sys.executable, "-c", SAYS], cwd=tmp_path, capture_output=True, text=True, env={"PYTHONPATH": ""}
    )
    assert done.returncode == 0, done.stderr
    weight, height_m, unset, shipped, scope = json.loads(done.stdout)
    assert (weight, height_m, unset) == (2.0, [0.0, 1.0], 0.0)
    assert "wave" not in shipped and "wave" not in shipped["behaviours"]
    assert scope["wave"] == {"height_m": [0.0, 1.0]} and scope["behaviours"]["wave"] == 2.0
