"""What a bundle from elsewhere brings as jobs, checked inside Blender: nothing of it counts."""

import json
import platform
import sys
import time

import bpy
from left_jobs import job_module, left_job, wait_until
from support import ENGINE, MODULE, OUT, conduct, copied_bundle, open_bundle, preferences, refused


def forged_job(bundle, **fields):
    """A *Set Up Engine* that ended with a program of the bundle, as a stranger writes it."""
    program = bundle / "python"
    program.write_text(f"#!/bin/sh\ntouch '{OUT.parent / 'evil_ran'}'\n")
    program.chmod(0o755)
    folder = bundle / ".jobs" / "20261126-120000-abcdef"
    folder.mkdir(parents=True)
    notes = {"operator": "r2sego.set_up_engine", "properties": {}, "bundle": "", "scene": "", "open": str(bundle)}
    record = {
        "format": 1,
        "title": "Set Up Engine",
        "command": [str(program), "-m", "r2sego_blender.workers.environment"],
        "started": time.time() - 60.0,
        "machine": platform.node(),
        "notes": notes,
        "starter": {"pid": 1, "birth": ""},
    }
    (folder / "job.json").write_text(json.dumps(record | fields))
    (folder / "end.json").write_text(json.dumps({"status": 0, "error": "", "ended": time.time(), "events": ""}))
    (folder / "events.jsonl").write_text(json.dumps({"event": "result", "python": str(program)}) + "\n")
    return folder


def check_a_strangers_finished_set_up_changes_no_preference_and_runs_nothing():
    for fields in ({}, {"signature": "0" * 64}, {"title": "\x1b[2J"}, {"started": float("nan")}, {"notes": []}):
        bundle = copied_bundle()
        folder = forged_job(bundle, **fields)
        following = sys.modules[f"{MODULE}.operators.engine.following"]
        open_bundle(bundle)
        assert following.unfollowed_jobs(bpy.context) == []
        for _ in range(3):
            following._tick()
        assert "No job was left behind" in refused(bpy.ops.r2sego.follow_job)
        said = refused(bpy.ops.r2sego.set_up_engine, job_folder=str(folder))
        assert "job.json" in said and "Traceback" not in said, said
        assert not len(bpy.context.window_manager.r2sego_engine.ended)
        assert preferences().engine_python == str(ENGINE) and folder.is_dir()
    assert not (OUT.parent / "evil_ran").exists()


def check_a_picture_is_the_jobs_own():
    bundle = copied_bundle()
    conduct("slow")
    job = left_job(bpy.ops.r2sego.refine)
    event = sys.modules[f"{MODULE}.r2sego_blender.workers.jobs"].Event
    job_module().show_event(event("picture", {"file": str(bundle / "evil.png")}))
    assert bpy.context.window_manager.r2sego_engine.picture == str(job.folder / "picture.png")
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
