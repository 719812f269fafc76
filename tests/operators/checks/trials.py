"""What holds of the room Trials, checked inside Blender."""

import json
import sys
from pathlib import Path

import bpy
from left_jobs import followed_to_its_end, job_module, left_job, wait_until
from support import ENGINE, MODULE, OUT, calls, conduct, refused

OPERATORS = {
    "end_study",
    "judge_trial",
    "open_study",
    "open_trials_page",
    "plan_trials",
    "run_trials",
    "show_trial_poses",
    "tell_session",
}
_DECLARATION = """
name = "Chairs"
trials = 2
chairs = ["office chair", "stool"]
[robot]
distance_m = [1.0, 1.5]
[[policies]]
condition = "GaussGym"
seed = 1
sha256 = "{a}"
[[policies]]
condition = "R2S-EGO"
seed = 1
sha256 = "{b}"
""".format(a="a" * 64, b="b" * 64)


def library(name):
    """A module of the add-on's library."""
    return sys.modules[f"{MODULE}.r2sego_blender.trials.{name}"]


def study(name="chairs"):
    """A study of its own, planned; nothing of it is open."""
    folder = OUT.parent / "studies"
    folder.mkdir(exist_ok=True)
    file = folder / f"{name}.toml"
    file.write_text(_DECLARATION)
    plan, path = library("plan.study").freeze_plan(file)
    bpy.ops.wm.read_homefile(use_empty=True)
    return plan, Path(path)


def opened(name):
    """A study of its own, open, with a simulated device chosen."""
    plan, path = study(name)
    assert bpy.ops.r2sego.open_study(directory=str(path)) == {"FINISHED"}
    group().simulated = True
    return plan, path


def group():
    return bpy.context.scene.r2sego_trials


def poses():
    """Where what is drawn of a trial stands: {name: (x, y, turn)}."""
    shown = [one for one in bpy.data.objects if one.type == "CURVE"]
    return {one.name: (*one.location[:2], one.rotation_euler.z) for one in shown}


def agree(found, planned):
    x, y, turn = found
    off = max(abs(x - planned.x_m), abs(y - planned.y_m), abs(turn * 180.0 / 3.141592653589793 - planned.heading_deg))
    return off < 1e-4


def check_a_study_is_opened_and_the_poses_of_its_trials_are_shown():
    plan, _ = opened("poses")
    assert group().facts.plan.digest == plan.digest and group().facts.next.number == 1
    for number in (1, 4):
        assert bpy.ops.r2sego.show_trial_poses(number=number) == {"FINISHED"}
        trial = plan.trials[number - 1]
        shown = poses()
        assert set(shown) == {f"Robot, trial {number}", f"{trial.chair}, trial {number}"}, shown
        assert agree(shown[f"Robot, trial {number}"], trial.robot_pose)
        assert agree(shown[f"{trial.chair}, trial {number}"], trial.chair_pose)
    assert "no trial 5" in refused(bpy.ops.r2sego.show_trial_poses, number=5)


def check_what_is_no_study_or_was_changed_is_told():
    bpy.ops.wm.read_homefile(use_empty=True)
    assert "no plan of trials here" in refused(bpy.ops.r2sego.open_study, directory=str(OUT.parent))
    assert group().study == ""
    _, path = opened("changed")
    text = (path / "plan.json").read_text()
    (path / "plan.json").write_text(text.replace("office chair", "other chair"))
    assert "changed after it was frozen" in refused(bpy.ops.r2sego.open_study, directory=str(path))


def check_a_study_is_planned_ended_and_printed_by_the_engine():
    _, path = opened("asked")
    conduct("succeed")
    declared = str(path.with_suffix(".toml"))
    assert "no plan of trials here" in refused(bpy.ops.r2sego.plan_trials, filepath=declared)  # it tells none
    assert "page is missing" in refused(bpy.ops.r2sego.open_trials_page)
    assert "reason" in refused(bpy.ops.r2sego.end_study, reason=" ")
    assert bpy.ops.r2sego.end_study(reason="the gantry broke") == {"FINISHED"}
    planned, page, ended = calls()
    assert planned[:3] == ["trials", "plan", declared]
    assert page[:3] == ["trials", "page", str(path)]
    assert ended[:5] == ["trials", "end", str(path), "--reason", "the gantry broke"]
    library("plan.study").end_study(path, "the gantry broke")
    assert bpy.ops.r2sego.open_study(directory=str(path)) == {"FINISHED"}
    assert group().facts.state.reason == "the gantry broke"
    assert "was ended" in refused(bpy.ops.r2sego.end_study, reason="again")
    assert "No trial is left" in refused(bpy.ops.r2sego.run_trials)


def check_a_session_is_started_with_its_device_and_calibration():
    _, path = opened("device")
    conduct("succeed")
    assert bpy.ops.r2sego.run_trials() == {"FINISHED"}
    group().simulated = False
    assert "where the device is" in refused(bpy.ops.r2sego.run_trials)
    group().device = "/dev/ttyACM0"
    assert "No calibration" in refused(bpy.ops.r2sego.run_trials)
    group().calibration, group().adapter, group().baud = "/cells.json", "mark10", 9600
    assert bpy.ops.r2sego.run_trials() == {"FINISHED"}
    simulated, real = calls()
    assert simulated == ["trials", "run", str(path), "--json-progress", "--simulated"]
    device = ["--device", "/dev/ttyACM0", "--calibration", "/cells.json", "--adapter", "mark10", "--baud", "9600"]
    assert real == [*simulated[:4], *device]


def _live(plan, index, **more):
    live = library("running.live")
    trial = plan.trials[index]
    return live.Live(
        state=live.State.SET_UP,
        next="Set up robot and chair.",
        index=index,
        total=len(plan.trials),
        label=trial.label,
        repetition=trial.repetition,
        tethered=True,
        robot_pose=trial.robot_pose.values,
        chair_pose=trial.chair_pose.values,
        chair=trial.chair,
        **more,
    )


def check_a_session_is_followed_ten_times_a_second_and_its_poses_move_on():
    plan, path = opened("followed")
    conduct("live")
    lives = [_live(plan, 0), _live(plan, 2, newtons=(("tether", 12.5),), support_s=1.25)]
    (ENGINE.parent / "live.jsonl").write_text("\n".join(json.dumps(one.to_json()) for one in lives))
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    assert group().live is None
    before = {one.session_uid for one in bpy.data.objects}
    left_job_of_session()
    wait_until(lambda: following._tick() and group().live is not None and group().live.index == 2)
    assert following._tick() == 0.1
    assert group().live == lives[1]
    shown = bpy.context.window_manager.r2sego_job
    assert shown.task == "Trial 3 of 4" and abs(shown.fraction - 0.5) < 1e-6
    trial = plan.trials[2]
    shown = poses()
    assert set(shown) == {"Robot, trial 3", f"{trial.chair}, trial 3"}
    assert agree(shown["Robot, trial 3"], trial.robot_pose)
    assert {one.session_uid for one in bpy.data.objects} == before  # no data that undo does not know
    assert bpy.ops.r2sego.tell_session(control="NOTE", text="a clap") == {"FINISHED"}
    assert bpy.ops.r2sego.tell_session(control="ARM") == {"FINISHED"}
    assert "names who judges" in refused(bpy.ops.r2sego.judge_trial, outcome="FAILURE", by="A. B.")
    assert bpy.ops.r2sego.judge_trial(outcome="FAILURE", by="A. B.", text="slid off") == {"FINISHED"}
    told = [json.loads(line) for line in (path / "controls.jsonl").read_text().splitlines()]
    assert told == [
        {"control": "note", "text": "a clap"},
        {"control": "arm"},
        {"control": "judge", "outcome": "failure", "by": "A. B.", "text": "slid off"},
    ]
    bpy.ops.r2sego.cancel()
    followed_to_its_end()
    assert group().live is None


def left_job_of_session():
    """A session as it is started with a window; the events that tell it apart are not read yet."""
    base = sys.modules[f"{MODULE}.operators.base"]
    waits, base.waits_for_engine = base.waits_for_engine, lambda context: False
    try:
        assert bpy.ops.r2sego.run_trials() == {"FINISHED"}
    finally:
        base.waits_for_engine = waits
    return job_module().current()


def check_a_session_that_tells_nonsense_is_passed_over():
    opened("nonsense")
    conduct("live")
    (ENGINE.parent / "live.jsonl").write_text('{"state": "DANCING"}\n{}')
    assert left_job(bpy.ops.r2sego.run_trials).running()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    following._tick()
    assert group().live is None
    bpy.ops.r2sego.cancel()
    followed_to_its_end()


def check_without_a_session_nobody_is_told():
    _, path = opened("alone")
    assert "no session" in refused(bpy.ops.r2sego.tell_session, control="ARM")
    assert not (path / "controls.jsonl").exists()


def check_a_file_that_is_loaded_knows_how_far_its_study_is():
    plan, path = opened("kept")
    blend = OUT.parent / "trials.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.read_homefile(use_empty=True)
    assert group().facts.plan is None
    library("plan.study").begin_study(path, plan)
    succeed(path, plan, 0)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert group().facts.plan.digest == plan.digest and group().facts.state.begun
    assert group().facts.next.number == 2 and len(poses()) == 2
    succeed(path, plan, 1)
    assert bpy.ops.r2sego.show_trial_poses() == {"FINISHED"}  # reads what others did meanwhile
    assert set(poses()) == {"Robot, trial 3", f"{plan.trials[2].chair}, trial 3"}


def succeed(path, plan, trial):
    """A record of a trial that succeeded, as another process writes it."""
    index, outcome = library("records.index").RecordIndex(path), library("outcome")
    number = index.begin(trial, plan.digest, True, True)
    index.judge(number, outcome.Judgement(outcome.Outcome.SUCCESS, (), 3.2, 5.0))


def check_blender_loads_nothing_of_the_line():
    opened("alone")
    assert {"serial", "mcap"}.isdisjoint(sys.modules)
