"""What holds of the room Engine, checked inside Blender."""

import contextlib
import os
import shutil
import signal
import sys
import threading
import time
from types import SimpleNamespace

import bpy
from left_jobs import followed_to_its_end, job_module, left_job, other_scene_shown, wait_until
from support import (
    BUNDLE,
    ENGINE,
    MODULE,
    OUT,
    bundle_of_one_name,
    calls,
    conduct,
    copied_bundle,
    open_bundle,
    open_here,
    refused,
    state,
)

OPERATORS = {"cancel", "check_backends", "check_engine", "demo_scene", "dismiss_job", "follow_job", "set_up_engine"}


def check_a_failing_engine_is_reported_in_its_own_words():
    open_bundle()
    conduct("fail")
    assert "images/a.png: it is empty" in refused(bpy.ops.r2sego.refine)
    end = bpy.context.window_manager.r2sego_engine.ended[-1]
    assert (end.level, end.line) == ("ERROR", "images/a.png: it is empty. Replace the file.")
    assert not bpy.context.window_manager.r2sego_job.running
    conduct("lack")
    told = refused(bpy.ops.r2sego.refine)
    assert "No module named 'click'" in told and "Press Check Engine" in told
    conduct("succeed")
    assert bpy.ops.r2sego.refine() == {"FINISHED"}


def check_ctrl_c_ends_a_wait_for_the_engine_and_blenders_handler_comes_back():
    """Blender without a window keeps the first for what it renders itself: here a handler in C that does nothing."""
    module = sys.modules[f"{MODULE}.operators.interruptible"]
    ignoring = int(signal.SIG_IGN)  # as C has it, of which Python's own module does not know here
    open_bundle()
    conduct("sleep")
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    module._set_handler(signal.SIGINT, ignoring)
    running = []

    def interrupt():
        wait_until((ENGINE.parent / "calls.jsonl").is_file)
        running.append(job_module().current())
        os.kill(os.getpid(), signal.SIGINT)

    presses = threading.Thread(target=interrupt)
    try:
        presses.start()
        ended = None
        with contextlib.suppress(KeyboardInterrupt, RuntimeError):
            ended = bpy.ops.r2sego.refine()
        presses.join()
        assert ended != {"FINISHED"} and not running[0].running()
        assert module._handler(signal.SIGINT) == ignoring
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGINT, before)


def check_a_job_is_followed_while_another_addon_is_disabled_in_the_middle_of_its_tool():
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    window = SimpleNamespace(modal_operators=[None])  # as Blender has it until the next event
    beginning = following.bpy
    following.bpy = SimpleNamespace(context=SimpleNamespace(window_manager=SimpleNamespace(windows=[window])))
    try:
        assert not following._being_edited()
        window.modal_operators.append(SimpleNamespace(bl_options={"REGISTER", "UNDO"}))
        assert following._being_edited()
    finally:
        following.bpy = beginning


def check_disabling_lets_a_job_go_on_and_enabling_finds_it():
    import addon_utils

    open_bundle()
    conduct("sleep")
    job = left_job(bpy.ops.r2sego.refine)
    assert job.folder.parent == BUNDLE / ".jobs"
    assert "busy" in refused(bpy.ops.r2sego.refine)
    started_s = time.monotonic()
    addon_utils.disable(MODULE, default_set=False)
    assert time.monotonic() - started_s < 10.0  # two seconds on a free machine
    assert job.running()
    addon_utils.enable(MODULE, default_set=False)
    open_bundle()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    (found,) = following.unfollowed_jobs(bpy.context)
    assert found.folder == job.folder and found.running()
    job_module().follow(found)
    assert bpy.context.window_manager.r2sego_job.title == "Refine"
    started_s = time.monotonic()
    assert bpy.ops.r2sego.cancel() == {"FINISHED"}
    assert bpy.context.window_manager.r2sego_job.cancel_requested
    wait_until(lambda: not found.running())
    assert time.monotonic() - started_s < 10.0  # two seconds on a free machine
    job_module().let_go()
    assert bpy.ops.r2sego.follow_job() == {"FINISHED"}
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert end.level == "WARNING" and end.line.startswith("Cancelled"), end.line
    assert following.unfollowed_jobs(bpy.context) == []


def check_a_job_that_was_left_behind_is_followed_and_told_once():
    open_bundle()
    conduct("slow")
    job = left_job(bpy.ops.r2sego.refine)
    job_module().let_go()
    assert bpy.ops.r2sego.follow_job() == {"FINISHED"}
    shown = bpy.context.window_manager.r2sego_job
    assert (shown.running, shown.title, shown.message) == (False, "Refine", "Round 1 of 2")
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.title, end.level, end.line) == ("Refine", "INFO", "Refined: 2 of 2 rounds")
    assert not job.folder.exists()
    assert "No job was left behind" in refused(bpy.ops.r2sego.follow_job)
    assert bpy.ops.r2sego.dismiss_job() == {"FINISHED"}
    assert "No job has ended" in refused(bpy.ops.r2sego.dismiss_job)


def check_a_job_is_taken_over_with_its_operators_properties():
    """New Scene has no bundle yet when it starts: its properties say what was made."""
    bpy.ops.wm.read_homefile(use_empty=True)
    conduct("slow")
    made = OUT.parent / "made.r2s"
    job = left_job(
        bpy.ops.r2sego.new_scene, filepath=str(made), captures="/photographs", scale="CAMERA_HEIGHT", camera_height=1.5
    )
    job_module().let_go()
    assert job.folder.parent == job_module().own_folder()
    kept = job.notes["properties"]
    assert (kept["filepath"], kept["scale"], kept["camera_height"]) == (str(made), "CAMERA_HEIGHT", 1.5)
    assert "robot" not in kept and "job_folder" not in kept
    shutil.copytree(BUNDLE, made)  # what the stand-in does not make
    bpy.ops.wm.read_homefile(use_empty=True)
    assert bpy.ops.r2sego.follow_job() == {"FINISHED"}
    assert state().bundle == str(made)


def check_the_timer_follows_a_job_shows_finished_steps_and_takes_the_result_over():
    """Its function is called here: timers do not run in background."""
    copy = copied_bundle()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    shown, engine = bpy.context.window_manager.r2sego_job, bpy.context.window_manager.r2sego_engine
    conduct("slow")
    job = left_job(bpy.ops.r2sego.refine)
    assert following._tick() < 0.5
    assert shown.running and shown.title == "Refine"
    (copy / "asset.ply").write_bytes(bytes(3_000_000))
    facts = {(fact.section, fact.label): fact.value for fact in state().facts}
    assert facts["asset", "asset.ply"] == "0.0 MB"
    (copy / "journal.jsonl").write_text("{}\n")
    following._tick()
    os.utime(copy / "journal.jsonl", (1, 1))  # a step is added
    following._tick()
    facts = {(fact.section, fact.label): fact.value for fact in state().facts}
    assert facts["asset", "asset.ply"] == "3.0 MB"
    wait_until(lambda: following._tick() and not shown.running)
    (end,) = engine.ended
    assert (end.level, end.line) == ("INFO", "Refined: 2 of 2 rounds")
    assert not job.folder.exists()


def check_what_a_finished_step_shows_anew_can_be_undone():
    """Blender crashes at an undo over objects that no step of its history has."""
    copy = copied_bundle()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    bpy.ops.r2sego.show_asset()
    for message in ("shown", "something", "something else"):
        bpy.context.scene.frame_current += 1
        bpy.ops.ed.undo_push(message=message)
    shown = bpy.context.scene.r2sego_asset.shown
    before = len(shown.data.vertices)
    (copy / "journal.jsonl").write_text("{}\n")
    os.utime(copy / "journal.jsonl", (2, 2))
    conduct("slow")
    left_job(bpy.ops.r2sego.refine)
    following._tick()
    shutil.copy(copy / "rounds" / "0" / "asset.ply", copy / "asset.ply")
    os.utime(copy / "journal.jsonl", (1, 1))  # a step is added
    following._tick()
    drawn = []
    for step in (None, bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
        if step:
            step()
        drawn.append(len(bpy.context.scene.r2sego_asset.shown.data.vertices))
        assert bpy.context.scene.r2sego_asset.shown.users_collection
    assert drawn[0] < before and drawn == [drawn[0], before, before, before, drawn[0]], drawn
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)


def check_the_timer_finds_the_job_of_a_file_that_was_loaded():
    open_bundle()
    conduct("sleep")
    job = left_job(bpy.ops.r2sego.refine)
    blend = OUT.parent / "job.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    job_module().let_go()
    bpy.ops.wm.read_homefile(use_empty=True)
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    following._tick()
    assert job_module().current() is None
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    following._tick()
    assert job_module().current().folder == job.folder
    bpy.ops.r2sego.cancel()
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.title, end.level) == ("Refine", "WARNING")


def check_a_job_that_cannot_be_followed_is_given_up_and_the_timer_goes_on():
    open_bundle()
    conduct("sleep")
    job = left_job(bpy.ops.r2sego.refine)
    following = sys.modules[f"{MODULE}.operators.engine.following"]

    def broken():
        raise ValueError("a mistake of this program")

    job.events = broken
    assert following._tick() > 0.0
    assert not bpy.context.window_manager.r2sego_job.running
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.title, end.level) == ("Refine", "ERROR")
    assert job.folder not in [found.folder for found in following.unfollowed_jobs(bpy.context)]
    following._tick()
    assert job_module().current() is None
    job.stop()
    job.forget()


def check_a_job_whose_end_cannot_be_taken_over_is_given_up_once():
    open_bundle()
    conduct("succeed")
    job = left_job(bpy.ops.r2sego.refine)
    wait_until(lambda: not job.running())
    following = sys.modules[f"{MODULE}.operators.engine.following"]

    def broken(found):
        raise TypeError("a mistake of this program")

    take_over, following.take_over = following.take_over, broken
    try:
        for _ in range(3):
            following._tick()
    finally:
        following.take_over = take_over
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.title, end.level) == ("Refine", "ERROR")
    assert job.folder.exists() and job_module().current() is None
    job.forget()


def check_an_argument_may_be_longer_than_any_path():
    conduct("succeed")
    missing = OUT.parent / "not_made.r2s"
    said = refused(bpy.ops.r2sego.new_scene, filepath=str(missing), captures="/a", scope=500 * "s")
    assert "not_made.r2s" in said and "Traceback" not in said, said  # the stand-in makes no bundle
    assert 500 * "s" in calls()[0]


def check_a_job_of_a_bundle_that_is_not_open_is_only_told():
    copy = copied_bundle()
    conduct("slow")
    job = left_job(bpy.ops.r2sego.refine)
    job_module().let_go()
    open_bundle()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    wait_until(lambda: not job.running())
    following.take_over(job)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.level, end.line) == ("INFO", f"Refine of {copy.name}: done")
    assert state().bundle == str(BUNDLE) and not job.folder.exists()


def check_a_jobs_end_is_read_where_its_bundle_is_open():
    copy = copied_bundle()
    first = bpy.context.scene
    conduct("slow")
    left_job(bpy.ops.r2sego.refine)
    other = other_scene_shown()
    (copy / "asset.ply").write_bytes(bytes(5_000_000))
    assert followed_to_its_end() == "Refined: 2 of 2 rounds"
    facts = {(fact.section, fact.label): fact.value for fact in first.r2sego.facts}
    assert facts["asset", "asset.ply"] == "5.0 MB" and not len(other.r2sego.facts)


def check_what_a_job_left_is_read_though_its_operator_could_not_be_pressed_now():
    copy = copied_bundle()
    mesh = bpy.data.meshes.new("floor")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    outline = bpy.data.objects.new("floor", mesh)
    bpy.context.scene.collection.objects.link(outline)
    bpy.context.view_layer.objects.active = outline
    conduct("slow")
    left_job(bpy.ops.r2sego.region_from_object)
    bpy.context.view_layer.objects.active = None
    (copy / "asset.ply").write_bytes(bytes(5_000_000))
    assert followed_to_its_end() == f"Region from Object of {copy.name}: done"
    facts = {(fact.section, fact.label): fact.value for fact in bpy.context.scene.r2sego.facts}
    assert facts["asset", "asset.ply"] == "5.0 MB"


def check_a_job_and_its_end_name_their_bundle_where_the_scenes_show_several():
    open_bundle()
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    attic = OUT.parent / "copies" / "attic.r2s"
    shutil.rmtree(attic, ignore_errors=True)
    shutil.copytree(BUNDLE, attic)
    shown, titles = bpy.context.window_manager.r2sego_job, []
    for begin, while_running, of in (
        (lambda: None, lambda: None, ""),
        (lambda: None, lambda: other_scene_shown() and open_here(attic), BUNDLE.stem),
        (lambda: None, lambda: None, "attic"),
        (lambda: open_here(bundle_of_one_name()), lambda: None, f"copies/{BUNDLE.stem}"),
    ):
        begin()
        conduct("slow")
        left_job(bpy.ops.r2sego.refine)
        while_running()
        following._tick()
        assert (shown.title, shown.of_bundle) == ("Refine", of), (shown.of_bundle, of)
        followed_to_its_end()
        titles.append(bpy.context.window_manager.r2sego_engine.ended[-1].title)
    names = (BUNDLE.stem, "attic", f"copies/{BUNDLE.stem}")
    assert titles == ["Refine", *(f"Refine of {name}" for name in names)], titles


def check_what_was_made_for_a_blender_scene_that_is_gone_is_told():
    for name, leave in (
        ("removed", lambda first: bpy.data.scenes.remove(first)),
        ("other_file", lambda first: open_bundle()),
        ("other_bundle", lambda first: open_here(BUNDLE)),
    ):
        bpy.ops.wm.read_homefile(use_empty=True)
        first, made = bpy.context.scene, OUT.parent / f"{name}.r2s"
        conduct("slow")
        left_job(bpy.ops.r2sego.new_scene, filepath=str(made), captures="/photographs")
        if name == "removed":
            other_scene_shown()
        leave(first)
        before = state().bundle
        shutil.copytree(BUNDLE, made)  # what the stand-in does not make
        said = followed_to_its_end()
        assert said.startswith(f"New Scene of {name}.r2s: done. Its Blender scene is gone or shows"), said
        assert said.endswith(f"open {made} with Open Scene") and state().bundle == before
        open_bundle(made)


def check_a_preview_picture_is_read_once_and_again_when_it_changes():
    pictures = sys.modules[f"{MODULE}.operators.engine.pictures"]
    engine = bpy.context.window_manager.r2sego_engine
    file = OUT.parent / "picture.png"

    def seen(width, changed_s):
        image = bpy.data.images.new("picture", width, 24)
        image.filepath_raw, image.file_format = str(file), "PNG"
        image.save()
        os.utime(file, (changed_s, changed_s))  # Blender knows pictures by whole seconds
        engine.picture = str(file)
        pictures.show(engine)
        return pictures._previews["picture"]

    first = seen(32, 1_000)
    assert first.image_size[:] == (32, 24), first.image_size[:]
    pictures.show(engine)
    assert pictures._previews["picture"] == first
    assert seen(48, 2_000).image_size[:] == (48, 24)
    file.unlink()
    pictures.show(engine)  # between two pictures
    pictures.clear(engine)
    assert (engine.picture, engine.picture_icon) == ("", 0)
