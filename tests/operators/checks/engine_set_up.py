"""What holds of the engine's set-up and of the question to it, checked inside Blender."""

import contextlib
import importlib.util
import sys

import bpy
from support import ENGINE, MODULE, OUT, preferences, refused


def check_the_engines_answer_is_kept_until_another_is_chosen():
    told = sys.modules[f"{MODULE}.panels.engine"].told_of_engine
    known = bpy.context.window_manager.r2sego_engine
    known.found = ""
    assert told(known)[0] == "Idle, not checked yet"
    assert bpy.ops.r2sego.check_engine() == {"FINISHED"}
    assert known.found == "engine: Python 3.99, r2sego 0.1.0, torch 9.9"
    assert told(known)[0] == "Ready"
    preferences().engine_python = "/nowhere/python"
    assert known.found == ""
    assert "/nowhere/python" in refused(bpy.ops.r2sego.check_engine)
    preferences().engine_python = str(ENGINE)


def check_the_learned_models_are_asked_for_and_listed():
    known = bpy.context.window_manager.r2sego_engine
    for _ in range(2):  # a second look takes the first one's place
        assert bpy.ops.r2sego.check_backends() == {"FINISHED"}
        assert [(one.name, one.why, one.licence) for one in known.backends] == [
            ("A Model", "", "MIT"),
            ("Another", "Another is not set up", "CC BY-NC 4.0"),
        ]
    preferences().engine_python = "/nowhere/python"
    assert "/nowhere/python" in refused(bpy.ops.r2sego.check_backends)
    preferences().engine_python = str(ENGINE)


def check_setting_up_the_engine_needs_leave_to_go_online():
    assert not bpy.app.online_access
    assert "online access" in refused(bpy.ops.r2sego.set_up_engine)


def check_an_engine_is_set_up_from_a_folder_of_wheels():
    """The folder lacks the packages: the failure is told, and what was begun stays for another try."""
    wheels = OUT.parent / "wheels"
    wheels.mkdir(exist_ok=True)
    with disk_needed_mb(0):
        said = refused(bpy.ops.r2sego.set_up_engine, wheels=str(wheels))
    if importlib.util.find_spec("ensurepip") is None:  # Debian without python3-venv
        assert "an environment cannot be made here" in said and "python3-venv" in said, said
    else:
        assert "packages cannot be installed" in said and "try again" in said, said
    assert preferences().engine_python == str(ENGINE)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    assert (end.title, end.level) == ("Set Up Engine", "ERROR")


def check_on_windows_the_engines_files_are_no_deeper_than_260_characters():
    places = sys.modules[f"{MODULE}.r2sego_blender.bridge.engine.user_folder"]
    before, places._LOCAL_DATA = places._LOCAL_DATA, str(OUT.parent / "Local")
    try:
        below = places.engine_folder().relative_to(OUT.parent / "Local")
    finally:
        places._LOCAL_DATA = before
    assert str(below).endswith("{}.{}".format(*bpy.app.version))
    local_data, packages = "C:/Users/twenty_letters_long_/AppData/Local/", "/Lib/site-packages/"
    longest_in_torch = 167
    assert len(local_data) + len(str(below)) + len(packages) + longest_in_torch < 260


def check_setting_up_the_engine_needs_a_blender_that_stays_where_it_is():
    """As macOS starts one that was downloaded and not moved to Applications."""
    before = sys.executable
    sys.executable = "/private/var/folders/x1/T/AppTranslocation/5D/d/Blender.app/python/bin/python3.11"
    try:
        said = refused(bpy.ops.r2sego.set_up_engine, wheels=str(OUT.parent))
    finally:
        sys.executable = before
    assert "Move Blender to Applications" in said


def check_a_disk_without_room_for_the_engine_is_told():
    with disk_needed_mb(10**12):
        said = refused(bpy.ops.r2sego.set_up_engine, wheels=str(OUT.parent))
    assert "MB left" in said and f"{10**12} MB are needed" in said, said


@contextlib.contextmanager
def disk_needed_mb(needed_mb):
    """The engine asks for so much room meanwhile; what is free here is not the checks' matter."""
    set_up = sys.modules[f"{MODULE}.operators.engine.set_up_engine"]
    before, set_up.REQUIRED_MB = set_up.REQUIRED_MB, needed_mb
    try:
        yield
    finally:
        set_up.REQUIRED_MB = before
