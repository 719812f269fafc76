"""Any operator by its name, with pip bpy."""

from functools import partial

import pytest
from example_runs import EXAMPLES, run_example

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_example, "press_buttons.py")


def test_buttons_are_pressed_in_their_order_with_their_properties(bundle_path, blender_environment, tmp_path):
    blend = tmp_path / "room.blend"
    done = run(
        blender_environment,
        bundle_path,
        "import_captures",
        "points=False",
        "look_through",
        "show_proxy",
        "look_inside=False",
        "--select",
        "capture_1",
        "--save",
        blend,
    )
    assert done.returncode == 0, done.stderr
    pressed = [line for line in done.stdout.splitlines() if line.endswith(": finished")]
    assert pressed == ["import_captures: finished", "look_through: finished", "show_proxy: finished"]
    assert blend.is_file()


def test_buttons_are_pressed_without_a_choice_of_an_object(bundle_path, blender_environment, tmp_path):
    blend = tmp_path / "room.blend"
    done = run(blender_environment, "--save", blend, bundle_path, "show_proxy", "look_inside=False")
    assert done.returncode == 0, done.stderr
    assert "show_proxy: finished" in done.stdout and blend.is_file()


def test_what_is_no_operator_is_said(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "show_everything")
    assert done.returncode == 1
    assert "there is no operator 'show_everything'" in done.stderr and "Traceback" not in done.stderr


def test_a_number_that_blender_would_move_into_its_range_is_refused(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "set_clearance", "clearance=-1")
    assert done.returncode == 1
    assert "clearance is -1" in done.stderr and "Traceback" not in done.stderr


def test_every_operator_is_listed_with_what_it_does(blender_environment):
    done = run(blender_environment, "--list")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "): " in line]
    assert len(lines) >= 80
    listed = {name: words.partition("): ")[0].split(", ") for name, _, words in (x.partition("(") for x in lines)}
    assert listed["show_proxy"] == ["look_inside"] and listed["clear_region"] == [""]
    known = ""  # the script's own examples name what there is
    for word in (EXAMPLES / "press_buttons.py").read_text(encoding="utf-8").split('"""')[1].split():
        name, equals, _ = word.partition("=")
        known = word if word in listed else known
        assert not equals or name in listed[known], word
