"""A plan is read whole or refused with the key that is wrong and the cure."""

from __future__ import annotations

import os
import sys

import pytest
from bundles import new_bundle
from fake_experiment import PLAN

from r2sego_blender.config.presets import preset, with_overrides
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.evaluation.arms import DEFAULT_ARMS
from r2sego_blender.experiments.plan import Plan, PlannedPreset

SCENE = '[[scenes]]\ncaptures = "room"\nfrozen = "held_out"\n'


def load(file, text):
    file.write_text(text)
    return Plan.load(file)


def test_paths_are_the_plans_and_names_the_folders(plan, plan_file, monkeypatch, tmp_path):
    monkeypatch.chdir("/")
    (scene,) = plan.scenes
    assert (scene.captures, scene.frozen) == (tmp_path / "room", tmp_path / "held_out")
    assert scene.name == "room" and scene.poses is None and not scene.is_bundle
    assert plan.counts == (3, 5) and plan.seeds == (0, 1) and plan.presets == (PlannedPreset("paper", "paper"),)
    plain = load(plan_file, SCENE)
    assert plain.arms == DEFAULT_ARMS and plain.counts == () and plain.seeds == (0,)


def test_settings_are_those_of_preset_overrides_and_seed(plan_file):
    text = (
        SCENE
        + '[[presets]]\npreset = "preview"\nname = "short"\noverrides = { training.steps_per_round = 7, rounds = 1 }\n'
    )
    (one,) = load(plan_file, text).presets
    expected = with_overrides({"training.steps_per_round": 7, "rounds": 1, "seed": 4}, preset("preview"))
    assert one.name == "short" and one.settings(4) == expected


def test_where_nothing_is_refined_methods_of_others_alone_are_compared(plan_file):
    arms = 'arms = ["same_points", "refined", "without_generated_views", "vanilla_3dgs"]\n'
    every = load(plan_file, "counts = [3, 5, 9]\n" + arms + SCENE)
    assert {every.arms_at(count) for count in every.counts} == {every.arms}
    first = load(plan_file, "counts = [3, 5, 9]\nrefined_counts = [3]\n" + arms + SCENE)
    assert first.arms_at(3) == every.arms
    assert first.arms_at(5) == first.arms_at(9) == ("same_points", "vanilla_3dgs")


@pytest.mark.parametrize(
    ("written", "given"), [("1.587", "1.587"), ('"1.5"', "1.5"), ('"robot"', "robot"), ("2", "2.0")]
)
def test_a_camera_height_is_a_number_or_a_word(plan_file, written, given):
    assert load(plan_file, SCENE + f"camera_height = {written}\n").scenes[0].camera_height == given


@pytest.mark.parametrize(
    ("text", "key", "cure"),
    [
        ("sedes = [1]\n" + SCENE, "sedes", "Did you mean seeds?"),
        ('arms = ["vanila_3dgs"]\n' + SCENE, "arms", "Did you mean vanilla_3dgs?"),
        ("arms = []\n" + SCENE, "arms", "same_points"),
        ("counts = [2]\n" + SCENE, "counts[0]", "from 3"),
        ("counts = [3, 3]\n" + SCENE, "counts has 3 twice", "once"),
        ("counts = [3]\nrefined_counts = [5]\n" + SCENE, "refined_counts has 5", "of the counts"),
        ('counts = [3]\nrefined_counts = [3]\narms = ["refined"]\n' + SCENE, "refined_counts", "methods of others"),
        ("seeds = []\n" + SCENE, "seeds is empty", "at least one"),
        ("seeds = [-1]\n" + SCENE, "seeds[0]", "from 0"),
        ("counts = [6]\n", "scenes is empty", "at least one"),
        (SCENE + SCENE, "scenes has room twice", "name of their own"),
        (SCENE + SCENE.replace('"room"', '"ROOM"'), "twice", "name of their own"),
        (SCENE + 'robot = "embedded:humanoit"\n', "scenes[0].robot", "embedded:humanoid"),
        (SCENE + 'robot = "gone.xml"\n', "scenes[0].robot", "file"),
        (SCENE + 'scope = "sitdown"\n', "scenes[0].scope", "sit_down"),
        (SCENE + "camera_height = nan\n", "scenes[0].camera_height", "robot"),
        (SCENE + 'camera_height = "1\\u0000"\n', "scenes[0].camera_height", "robot"),
        (SCENE + 'camera_height = "1\\u001b[2J"\n', "scenes[0].camera_height", "robot"),
        (SCENE.replace('"room"', '"~nosuchuser/x"'), "scenes[0].captures", "another path"),
        (SCENE + 'poses = "~nosuchuser/x"\n', "scenes[0].poses", "another path"),
        (SCENE + 'name = "a/b"\n', "scenes[0].name", "letters, digits"),
        ('[[scenes]]\ncaptures = "room"\n', "scenes[0].frozen is missing", ""),
        (SCENE + "overrides = { rounds = 2 }\n", "scenes[0].overrides.rounds", "preset's"),
        (SCENE + "[[presets]]\noverrides = { captures.max_side_px = 320 }\n", "presets[0].overrides", "scene's"),
        (SCENE + "[[presets]]\noverrides = { seed = 3 }\n", "presets[0].overrides.seed", "all others but seed"),
        (SCENE + "[[presets]]\noverrides = { training.steps = 3 }\n", "training.steps'", "training.steps_per_round"),
        (SCENE + '[[presets]]\npreset = "papers"\n', "presets[0].preset", "paper"),
        (SCENE + "[[presets]]\n" * 2, "presets has paper twice", "once"),
        (f"seeds = {list(range(200))}\ncounts = {list(range(3, 60))}\n" + SCENE, "scenes make too many cells", "10000"),
        ("seeds = [", "is no TOML", "docs/experiments.md"),
    ],
)
def test_what_is_wrong_is_refused_by_its_key_with_the_cure(plan_file, text, key, cure):
    with pytest.raises(ExperimentError) as refused:
        load(plan_file, text)
    assert key in str(refused.value) and cure in refused.value.cure and str(plan_file) in str(refused.value)


def test_a_bundle_has_its_captures(plan_file, tmp_path):
    new_bundle(tmp_path / "made.r2s")
    of_bundle = SCENE.replace('"room"', '"made.r2s"')
    assert load(plan_file, of_bundle).scenes[0].is_bundle
    for given in ('robot = "embedded:wheeled"', 'scope = "sit_down"', "camera_height = 1.5"):
        with pytest.raises(ExperimentError, match=given.split()[0]):
            load(plan_file, f"{of_bundle}{given}\n")
    with pytest.raises(ExperimentError, match=r"scenes\[0\]\.captures is a bundle"):
        load(plan_file, "counts = [3]\n" + of_bundle)


def test_scenes_that_are_given_stand_in_place_of_the_plans(plan, plan_file):
    plan_file.write_text(PLAN[: PLAN.index("[[scenes]]")])
    assert Plan.load(plan_file, plan.scenes) == plan


@pytest.mark.parametrize("field", ["captures", "frozen", "poses", "robot", "scope"])
def test_a_name_too_long_for_the_disk_is_refused_by_its_field(plan_file, field):
    declared = {"captures": "room", "frozen": "held_out", field: "a" * 300}
    text = "[[scenes]]\n" + "".join(f'{key} = "{value}"\n' for key, value in declared.items())
    if sys.version_info >= (3, 14) or os.name == "nt":  # where it is a place at which nothing lies
        assert load(plan_file, text).scenes
        return
    with pytest.raises(ExperimentError, match=rf"scenes\[0\]\.{field}"):
        load(plan_file, text)


@pytest.mark.skipif(sys.platform != "linux" or sys.version_info >= (3, 14), reason="such a place is one without files")
def test_captures_in_which_nothing_can_be_looked_for_are_refused(plan_file, tmp_path):
    left = 4090 - len(str(tmp_path))  # of the longest path, and a file's name is longer than the rest
    with pytest.raises(ExperimentError, match="cannot be read"):
        load(plan_file, SCENE.replace('"room"', f'"{"a/" * (left // 2)}a"'))
