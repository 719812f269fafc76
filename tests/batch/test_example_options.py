"""Wrong options of the scripts are told in a line, with pip bpy."""

import pytest
from example_runs import run_example

pytest.importorskip("bpy", reason="pip bpy is not installed")

WRONG = (
    ("scene_settings.py", "--set", "rounds"),
    ("scene_settings.py", "--preset", "nonsense"),
    ("proxy_priors.py", "--move", "crate=1,2"),
    ("proxy_priors.py", "--decide", "crate"),
    ("proxy_masks.py", "--paint", "chair"),
    ("proxy_lasso.py", "--lasso", "capture_0"),
    ("proxy_edits.py", "--mask", "capture_0:1,1 5"),
    ("proxy_edits.py", "--cut-box", "1,2,3"),
    ("robot_rollouts.py", "--pitch", "20"),
    ("robot_region.py", "--object", "rug"),
)


@pytest.mark.parametrize(("script", "option", "value"), WRONG)
def test_a_wrong_option_is_named(blender_environment, script, option, value):
    done = run_example(script, blender_environment, "room.r2s", option, value)
    assert done.returncode == 2
    assert option in done.stderr.splitlines()[-1] and "Traceback" not in done.stderr


def test_the_scale_of_conditions_is_a_share(blender_environment, tmp_path):
    done = run_example("render_conditions.py", blender_environment, "room.r2s", "--to", tmp_path, "--scale", "7")
    assert done.returncode == 2 and "--scale 7" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("button", [("show_proxy", "nonsense=3"), ("new_object", "name=12")])
def test_a_wrong_property_of_a_button_is_told_in_one_line(blender_environment, bundle_path, button):
    done = run_example("press_buttons.py", blender_environment, bundle_path, *button)
    assert done.returncode == 1
    assert button[1].partition("=")[0] in done.stderr and "Traceback" not in done.stderr


def test_picks_that_are_not_there_are_told_by_their_file(blender_environment, bundle_path, tmp_path):
    for script in ("captures_picks.py", "captures_registration.py"):
        done = run_example(script, blender_environment, bundle_path, "--picks", tmp_path / "nowhere.json")
        assert done.returncode == 1
        assert "nowhere.json" in done.stderr and "Traceback" not in done.stderr
