"""What holds of the room Robot, checked inside Blender."""

import importlib
import json
import math
import shutil
import sys
from types import SimpleNamespace

import bpy
import numpy as np
from support import BUNDLE, MODULE, OUT, calls, conduct, copied_bundle, open_bundle, refused, state

OPERATORS = {
    "choose_robot",
    "choose_scope",
    "clear_region",
    "draw_region",
    "evaluate_policy",
    "inspect_robot",
    "jump_to_attempt",
    "pick_target",
    "region_from_object",
    "run_rollouts",
    "set_behaviours",
    "set_clearance",
    "set_mount",
    "show_policy_episode",
    "show_policy_starts",
    "show_rollout",
    "trust_policy",
    "try_rollouts",
}


def robot():
    """What the Blender scene knows of the robot."""
    return bpy.context.scene.r2sego_robot


def first_body(number):
    """The robot's first body of a shown rollout."""
    name = json.loads((BUNDLE / "rounds/0/bodies/bodies.json").read_text())["bodies"][0]
    return bpy.data.objects[f"Robot {name}, rollout {number}"]


def declared(operator, **properties):
    """The options an operator gives the engine's one command."""
    conduct("succeed")
    assert operator(**properties) == {"FINISHED"}
    (call,) = calls()
    assert call[:2] == ["robot", state().bundle.rstrip("/")] and call[-1] == "--json-progress", call
    return call[2:-1]


def check_opening_lists_the_attempts_and_the_seats():
    open_bundle()
    state().round_index = 0
    listed = robot().attempts
    assert [(one.number, one.success, one.reason, one.frame) for one in listed] == [
        (0, True, "", 10),
        (1, False, "body_contact", 4),
        (2, False, "no_goal", 0),
        (3, True, "", 7),
    ]
    assert robot().succeeded == 2
    assert [listed[0].outcome, listed[1].outcome] == ["succeeded", "mast touched the chair"]
    assert abs(listed[1].time_s - 0.8) < 1e-6
    assert [(seat.object_name, seat.places) for seat in robot().seats] == [("chair", 3), ("", 1)]
    facts = {fact.label: fact.value for fact in state().facts if fact.section == "robot"}
    assert facts["Body"] == "29 joints, 2 legs, 1.31 m, 35 kg"
    assert facts["Region"] == "the free floor"
    robot().source = "TRIAL"
    assert len(robot().attempts) == 2
    robot().source = "ROUND"
    assert len(robot().attempts) == 4


def check_the_dialogs_of_a_bundle_that_is_gone_say_so():
    open_bundle()
    state().bundle = gone = str(OUT.parent / "nowhere" / "room.r2s")
    for name in ("choose_robot", "choose_scope", "set_mount", "set_behaviours", "set_clearance"):
        said = refused(getattr(bpy.ops.r2sego, name), "INVOKE_DEFAULT")
        assert gone in said and "Traceback" not in said, said


def check_choosing_robot_and_scope_asks_the_engine():
    open_bundle()
    ops = bpy.ops.r2sego
    assert declared(ops.choose_robot, robot="WHEELED") == ["--robot", "embedded:wheeled"]
    assert declared(ops.choose_robot, robot="FILE", filepath="/a/b.xml") == ["--robot", "/a/b.xml"]
    assert "robot file" in refused(ops.choose_robot, robot="FILE", filepath="")
    assert declared(ops.choose_scope, scope="sit_down") == ["--scope", "sit_down"]
    assert declared(ops.choose_scope, scope="FILE", filepath="/a/b.toml") == ["--scope", "/a/b.toml"]
    assert "scope file" in refused(ops.choose_scope, scope="FILE", filepath="")
    assert declared(ops.inspect_robot) == []
    assert declared(ops.inspect_robot, seats=True) == ["--seats"]
    assert declared(ops.set_behaviours, walk_to=0.25, look_around=0.0, sit_on=1.0) == [
        "--set",
        "behaviours.walk_to=0.25",
        "--set",
        "behaviours.look_around=0",
        "--set",
        "behaviours.step_around=0",
        "--set",
        "behaviours.squat=0",
        "--set",
        "behaviours.sit_on=1",
    ]
    weights = ops.set_behaviours.get_rna_type().properties
    assert (weights["walk_to"].name, weights["walk_to"].hard_max) == ("Walk To", 1000.0)
    assert weights["squat"].description == "Stand, lower the body and look down, as for reaching; takes legs"


def check_a_program_is_trusted_by_a_file_that_a_person_chose():
    open_bundle()
    ops = bpy.ops.r2sego
    assert declared(ops.choose_scope, scope="FILE", filepath="/a/b.toml") == ["--scope", "/a/b.toml"]  # and no more
    conduct("succeed")
    assert ops.trust_policy(filepath="/a/b.pt") == {"FINISHED"}
    assert calls() == [["trust", "/a/b.pt", "--json-progress"]]
    assert "policy is chosen" in refused(ops.trust_policy, filepath="")


def check_the_dialog_of_the_scope_begins_with_what_is_declared():
    copy = copied_bundle()
    file, declaration = copy / "robot" / "scope.toml", copy / "scene.toml"
    text = declaration.read_text()
    dialogs = SimpleNamespace(invoke_props_dialog=lambda operator, **how: {"RUNNING_MODAL"})
    context = SimpleNamespace(scene=bpy.context.scene, window_manager=dialogs)
    for scope, shown in (
        ("walk_and_look", ("walk_and_look", "")),
        ("sit_down", ("sit_down", "")),
        (str(file), ("FILE", str(file))),
    ):
        declaration.write_text(text.replace('"walk_and_look"', json.dumps(scope)))
        dialog = SimpleNamespace(scope="", filepath="of before")
        assert bpy.types.R2SEGO_OT_choose_scope.invoke(dialog, context, None) == {"RUNNING_MODAL"}
        assert (dialog.scope, dialog.filepath) == shown


def check_the_clearance_that_cures_name_is_a_field():
    """Of the behaviour scope, in metres; its dialog begins with what is declared."""
    open_bundle()
    set_clearance = bpy.ops.r2sego.set_clearance
    assert declared(set_clearance, clearance=0.04) == ["--set", "region.clearance_m=0.04"]
    clearance = set_clearance.get_rna_type().properties["clearance"]
    assert (clearance.name, clearance.hard_min, clearance.hard_max) == ("Clearance", 0.0, 1.0)
    assert abs(clearance.default - 0.08) < 1e-6
    assert bpy.types.R2SEGO_PT_region.bl_label == "Behaviour Region"


def check_the_right_mouse_button_cancels_and_ctrl_z_takes_a_corner_back():
    """Passed on, they would open Blender's menu and undo something else in the midst of a tool."""
    open_bundle()

    def pressed(kind, ctrl=False):
        return SimpleNamespace(type=kind, value="PRESS", ctrl=ctrl, oskey=False, mouse_x=0, mouse_y=0)

    for tool in (bpy.types.R2SEGO_OT_pick_target, bpy.types.R2SEGO_OT_draw_region):
        for kind in ("ESC", "RIGHTMOUSE"):
            assert tool.on_event(SimpleNamespace(), bpy.context, pressed(kind)) == {"CANCELLED"}
    shown = []
    tool = SimpleNamespace(_corners=[(0.0, 0.0), (1.0, 0.0)], _show=shown.append)
    draw = bpy.types.R2SEGO_OT_draw_region.on_event
    assert draw(tool, bpy.context, pressed("Z", ctrl=True)) == {"RUNNING_MODAL"}
    assert draw(tool, bpy.context, pressed("BACK_SPACE")) == {"RUNNING_MODAL"}
    assert tool._corners == [] and len(shown) == 2


def check_the_mount_is_told_in_toml():
    import tomllib

    open_bundle()
    mount = bpy.ops.r2sego.set_mount

    def told(**properties):
        options = declared(mount, **properties)
        assert options[::2] == ["--set", "--set"]
        fields = dict(option.split("=", 1) for option in options[1::2])
        return [tomllib.loads(f"v = {value}")["v"] if value else None for value in fields.values()]

    assert told(mount="OWN", pitch="MOUNTED") == [None, None]
    assert told(mount="CAMERA", camera='a "b"', pitch="MOUNTED") == ['a "b"', None]
    place, pitch = told(
        mount="PLACE",
        body="torso",
        place=(0.1, 0.0, 0.25),
        turn=(0.0, 0.5, 0.0),
        pitch="DRAWN",
        field_of_view=math.radians(80),
        pitch_low=math.radians(10),
        pitch_high=math.radians(40),
    )
    assert place[0] == "torso"
    np.testing.assert_allclose(place[1], (0.1, 0.0, 0.25), atol=1e-6)
    np.testing.assert_allclose(place[2], (0.0, 0.5, 0.0), atol=1e-6)
    assert abs(place[3]["hfov_deg"] - 80.0) < 1e-3
    np.testing.assert_allclose(pitch, (10.0, 40.0), atol=1e-3)
    reversed_pitch = {"pitch": "DRAWN", "pitch_low": math.radians(60), "pitch_high": math.radians(10)}
    assert "the pitch goes from 60° to 10°" in refused(mount, mount="OWN", **reversed_pitch).lower()


def check_the_mount_suggests_what_the_robot_has():
    suggested = importlib.import_module(f"{MODULE}.operators.robot.set_mount").suggested_properties
    told = {"camera": {"parent": "base"}, "cameras": ["mast_camera"]}
    assert suggested(told) == {"body": "base", "camera": "mast_camera"}
    assert suggested({"camera": {"parent": "base"}, "cameras": []}) == {"body": "base"}
    assert suggested({}) == {}


def check_a_mount_that_was_placed_is_shown_again_as_it_was_declared():
    import dataclasses
    import tomllib

    open_bundle()
    module = importlib.import_module(f"{MODULE}.operators.robot.set_mount")
    facts = importlib.import_module(f"{MODULE}.r2sego_blender.results.panels.robot_facts")
    bundle = importlib.import_module(f"{MODULE}.r2sego_blender.results.panels.bundle").Bundle.open(BUNDLE)
    scope = facts.RobotFacts.read(bundle).scope

    def shown(mount, pitch=None):
        changed = dataclasses.replace(
            scope,
            robot=dataclasses.replace(scope.robot, mount=mount),
            look=dataclasses.replace(scope.look, camera_pitch_deg=pitch),
        )
        return module.declared_properties(changed)

    place = ["pelvis", [0.1, -0.2, 0.5], [0.0, 0.25, 3.0]]
    wide, high = {"hfov_deg": 80.0}, {"fovy_deg": 50.0}
    table = {"parent": place[0], "xyz": place[1], "rpy": place[2], **wide}
    for mount, fov in (([*place, wide], wide), (table, wide), ([*place, high], high), ([*place, 50.0], high)):
        options = declared(bpy.ops.r2sego.set_mount, **shown(mount, (10.0, 40.0)))
        mounted, pitch = (tomllib.loads(f"v = {option.partition('=')[2]}")["v"] for option in options[1::2])
        assert mounted == [*place, fov], mounted
        np.testing.assert_allclose(pitch, (10.0, 40.0), atol=1e-4)
    assert shown(None) == {"mount": "OWN", "pitch": "MOUNTED"}
    assert shown("eyes") == {"mount": "CAMERA", "camera": "eyes", "pitch": "MOUNTED"}


def check_regions_are_told_in_metres():
    open_bundle()
    polygon = "0,0 2,0.5 1.25,2"
    assert declared(bpy.ops.r2sego.draw_region, polygon=polygon) == [
        "--region",
        "0.0000,0.0000 2.0000,0.5000 1.2500,2.0000",
    ]
    assert "crosses itself" in refused(bpy.ops.r2sego.draw_region, polygon="0,0 1,1 1,0 0,1")
    assert "corners" in refused(bpy.ops.r2sego.draw_region)
    assert declared(bpy.ops.r2sego.clear_region) == ["--region", "free_floor"]


def check_a_region_is_an_objects_outline():
    open_bundle()
    assert "Select a mesh" in refused(bpy.ops.r2sego.region_from_object)
    bpy.ops.mesh.primitive_plane_add(size=2.0, location=(1.0, 0.5, 0.0))
    (option, polygon) = declared(bpy.ops.r2sego.region_from_object)
    corners = sorted(tuple(map(float, pair.split(","))) for pair in polygon.split())
    assert option == "--region"
    assert corners == [(0.0, -0.5), (0.0, 1.5), (2.0, -0.5), (2.0, 1.5)]


def check_the_bundles_own_region_is_shown():
    copy = copied_bundle()
    own = copy / "robot" / "scope.toml"
    own.write_text("[region]\nwithin = [[0, 0], [2, 0], [2, 1.5]]\n")
    declaration = copy / "scene.toml"
    declaration.write_text(declaration.read_text().replace('"walk_and_look"', json.dumps(str(own))))
    assert bpy.ops.r2sego.refresh_scene() == {"FINISHED"}
    assert state().problem == robot().problem == ""
    assert robot().region == "0.0000,0.0000 2.0000,0.0000 2.0000,1.5000"
    overlay = sys.modules[f"{MODULE}.panels.overlays.region_overlay"]
    corners, sides, triangles = overlay.shape_of(robot().region)
    assert (corners.shape, sides.shape, len(triangles)) == ((3, 3), (6, 3), 1)
    for shown in (True, False):  # the 3D view's own switch of overlays
        view = SimpleNamespace(overlay=SimpleNamespace(show_overlays=shown))
        drawn = overlay.drawn_region(SimpleNamespace(scene=bpy.context.scene, space_data=view))
        assert (drawn is not None) == shown
    own.write_text("[region]\nwithin = 3\n")
    bpy.ops.r2sego.refresh_scene()
    assert "region.within" in robot().problem and state().problem == ""
    assert robot().region == ""


def check_targets_are_told_by_name_or_place():
    open_bundle()
    assert declared(bpy.ops.r2sego.pick_target, target="chair") == ["--target", "chair"]
    assert declared(bpy.ops.r2sego.pick_target, target="1.2,-0.4") == ["--target", "1.2,-0.4"]
    assert "Nothing is there" in refused(bpy.ops.r2sego.pick_target)


def check_a_trial_asks_the_engine_and_is_listed():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.try_rollouts(attempts=4) == {"FINISHED"}
    assert calls() == [["try-rollouts", str(BUNDLE), "--attempts", "4", "--json-progress"]]
    assert robot().source == "TRIAL" and len(robot().attempts) == 2


def check_a_rounds_rollouts_are_run_alone():
    open_bundle()
    conduct("succeed")
    state().round_index = 0
    robot().source = "TRIAL"
    assert bpy.ops.r2sego.run_rollouts() == {"FINISHED"}
    assert bpy.ops.r2sego.run_rollouts(round_index=1) == {"FINISHED"}
    assert calls() == [["rollouts", str(BUNDLE), "--round", n, "--json-progress"] for n in ("0", "1")]
    assert robot().source == "ROUND" and len(robot().attempts) == 4


def check_a_rollout_follows_the_timeline():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.show_rollout(round_index=0, attempt=3) == {"FINISHED"}
    assert not (OUT.parent / "engine" / "calls.jsonl").exists()  # the bodies are there: no engine
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (0, 7)
    poses = np.load(BUNDLE / "rounds/0/bodies/poses.npz")["world_from_body_0003"]
    cameras = np.load(BUNDLE / "rounds/0/rollouts/rollouts.npz")["camera_poses_0003"]
    names = json.loads((BUNDLE / "rounds/0/bodies/bodies.json").read_text())["bodies"]
    for frame in [*range(8), 3, 9]:
        scene.frame_set(frame)
        for index, name in enumerate(names):
            shown = np.array(bpy.data.objects[f"Robot {name}, rollout 3"].matrix_world)
            assert np.abs(shown - poses[min(frame, 7), index]).max() < 1e-5, (frame, name)
        camera = np.array(bpy.data.objects["Head camera 3"].matrix_world) @ np.diag([1, -1, -1, 1])
        assert np.abs(camera - cameras[min(frame, 7)]).max() < 1e-5, frame


def check_all_successful_rollouts_are_shown_together():
    open_bundle()
    state().round_index = 0
    assert bpy.ops.r2sego.show_rollout(every=True, look_through=True) == {"FINISHED"}
    assert {o.name for o in bpy.data.objects if o.type == "EMPTY"} == {"Rollout 0", "Rollout 3"}
    assert bpy.context.scene.camera.name == "Head camera 0"


def check_jumping_goes_to_the_frame_of_the_failure():
    open_bundle()
    state().round_index = 0
    scene = bpy.context.scene
    assert bpy.ops.r2sego.jump_to_attempt(attempt=1) == {"FINISHED"}
    assert (scene.frame_current, scene.frame_end, robot().attempt_index) == (4, 4, 1)
    body = first_body(1)
    poses = np.load(BUNDLE / "rounds/0/bodies/poses.npz")["world_from_body_0001"]
    assert np.abs(np.array(body.matrix_world) - poses[4, 0]).max() < 1e-5
    assert bpy.ops.r2sego.jump_to_attempt(attempt=0) == {"FINISHED"}
    assert (scene.frame_current, scene.frame_end) == (10, 10)
    assert bpy.ops.r2sego.jump_to_attempt(attempt=2) == {"FINISHED"}  # it never began: nothing changes
    assert "Rollout 0" in bpy.data.objects and robot().attempt_index == 2
    assert "Rollout 2 never began" in refused(bpy.ops.r2sego.show_rollout, attempt=2)
    assert "no attempt 9" in refused(bpy.ops.r2sego.jump_to_attempt, attempt=9)
    assert bpy.ops.r2sego.jump_to_attempt(attempt=1, trial=True) == {"FINISHED"}
    assert scene.frame_current == 4


def check_missing_bodies_are_asked_of_the_engine():
    open_bundle()
    conduct("succeed")
    assert "are missing" in refused(bpy.ops.r2sego.show_rollout, round_index=1)  # the stand-in writes none
    assert calls() == [["robot-bodies", str(BUNDLE), "--round", "1", "--json-progress"]]


def check_what_a_person_puts_beside_the_robot_stays_as_it_is():
    open_bundle()
    bpy.ops.r2sego.show_rollout(round_index=0, attempt=0)
    body = first_body(0)
    mine = bpy.data.objects.new("mine", None)
    mine.rotation_euler, mine.scale = (0.3, 0.0, 10.0), (-1.0, 1.0, 0.0)
    body.users_collection[0].objects.link(mine)
    bpy.context.scene.frame_set(6)
    assert max(abs(a - b) for a, b in zip(mine.rotation_euler, (0.3, 0.0, 10.0), strict=True)) < 1e-6
    assert tuple(mine.scale) == (-1.0, 1.0, 0.0)
    poses = np.load(BUNDLE / "rounds/0/bodies/poses.npz")["world_from_body_0000"]
    assert np.abs(np.array(body.matrix_world) - poses[6, 0]).max() < 1e-5


def check_shown_rollouts_move_again_in_a_loaded_file():
    open_bundle()
    bpy.ops.r2sego.show_rollout(round_index=0, attempt=0)
    blend = OUT.parent / "rollout.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    poses = np.load(BUNDLE / "rounds/0/bodies/poses.npz")["world_from_body_0000"]
    body = first_body(0)
    for frame in (0, 6, 2):
        bpy.context.scene.frame_set(frame)
        assert np.abs(np.array(body.matrix_world) - poses[frame, 0]).max() < 1e-5


def check_without_rollouts_the_buttons_say_why():
    copy = copied_bundle()
    shutil.rmtree(copy / "rounds" / "0" / "rollouts")
    state().round_index = 0
    bpy.ops.r2sego.refresh_scene()
    assert len(robot().attempts) == 0 and robot().problem == ""
    assert "no rollouts yet" in refused(bpy.ops.r2sego.show_rollout)
    bpy.ops.wm.read_homefile(use_empty=True)
    for name in OPERATORS:
        assert "Open a scene first" in refused(getattr(bpy.ops.r2sego, name)), name


def check_a_policy_is_evaluated_by_the_engine_into_the_bundle():
    open_bundle()
    conduct("succeed")
    kept = str(BUNDLE / "robot" / "policy")
    assert bpy.ops.r2sego.evaluate_policy() == {"FINISHED"}
    assert bpy.ops.r2sego.evaluate_policy(policy="/t/student", episodes=7, seed=3) == {"FINISHED"}
    options = (("teacher", "20", "0"), ("/t/student", "7", "3"))
    for call, (policy, episodes, seed) in zip(calls(), options, strict=True):
        assert call[:5] == ["policy", "evaluate", str(BUNDLE), "--policy", policy]
        assert call[5:9] == ["--episodes", episodes, "--seed", seed]
        assert call[9:] == ["--record", kept, "--json-progress"]


def check_a_recorded_evaluation_is_told_and_shown():
    open_bundle()
    told = robot().evaluation
    assert (told.successes, told.episodes, told.policy_name) == (1, 3, "student")
    assert [(one.reason, one.frames) for one in robot().episodes] == [("", 11), ("body_contact", 5), ("no_goal", 8)]
    assert bpy.ops.r2sego.show_policy_episode(episode=1, look_through=True) == {"FINISHED"}
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end, robot().episode_index) == (0, 4, 1)
    (background,) = scene.camera.data.background_images
    assert background.image.filepath.endswith("000.png") and background.image.size[:] == (128, 96)
    assert "no episode 9" in refused(bpy.ops.r2sego.show_policy_episode, episode=9)
    kept = bpy.ops.r2sego.show_policy_episode.get_rna_type().properties["in_editor"]
    assert kept.is_skip_save  # else Show does as Head did
    assert bpy.ops.r2sego.show_policy_starts() == {"FINISHED"}
    starts = bpy.data.objects["Start poses"]
    assert [one.name for one in starts.data.materials] == [
        "R2S-EGO start, success",
        "R2S-EGO start, body_contact",
        "R2S-EGO start, no_goal",
    ]


def check_without_an_evaluation_and_with_a_damaged_one_it_is_said():
    copy = copied_bundle()
    (copy / "robot" / "policy" / "evaluation.json").write_text("{}")
    bpy.ops.r2sego.refresh_scene()
    assert "evaluation.json" in robot().problem and robot().evaluation is None
    shutil.rmtree(copy / "robot" / "policy")
    bpy.ops.r2sego.refresh_scene()
    assert robot().problem == "" and len(robot().episodes) == 0
    for operator in (bpy.ops.r2sego.show_policy_episode, bpy.ops.r2sego.show_policy_starts):
        assert "No policy was evaluated" in refused(operator)
