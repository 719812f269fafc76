"""A bundle that leads out of itself, checked inside Blender: it is neither opened nor worked on."""

import shutil

import bpy
from support import OUT, bundle_of_one_name, conduct, copied_bundle, open_bundle, refused

LINKED = (
    ".jobs",
    "report",
    "rounds",
    "captures/images",
    "captures/cameras.json",
    "scene.toml",
    ".changes",
    "journal.jsonl",
)


def another_folder():
    """What a link leads to: another's folder with a letter in it."""
    folder = OUT.parent / "another"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "letter.txt").write_text("mine")
    return folder


def linked(bundle, name, folder):
    """Put a link in the place of ``name``; whether links can be made here."""
    place = bundle / name
    shutil.rmtree(place, ignore_errors=True)
    place.unlink(missing_ok=True)
    try:
        place.symlink_to(folder, target_is_directory=True)
    except OSError:  # Windows lets few users make links
        return False
    return True


def check_a_bundle_with_a_link_out_of_it_is_not_opened():
    for name in LINKED:
        bpy.ops.wm.read_homefile(use_empty=True)
        bundle, folder = bundle_of_one_name(), another_folder()
        if not linked(bundle, name, folder):
            return
        said = refused(bpy.ops.r2sego.open_scene, directory=str(bundle))
        assert (f"{name}: " in said or name == "scene.toml") and "Traceback" not in said, said
        assert [file.name for file in folder.iterdir()] == ["letter.txt"]


def check_an_open_bundle_that_a_link_was_put_into_is_not_worked_on():
    for name in LINKED:
        bundle, folder = copied_bundle(), another_folder()
        if not linked(bundle, name, folder):
            return
        conduct("slow")
        for operator in (bpy.ops.r2sego.refine, bpy.ops.r2sego.show_proxy, bpy.ops.r2sego.show_candidates):
            said = refused(operator)
            assert "Traceback" not in said, said
        assert [file.name for file in folder.iterdir()] == ["letter.txt"]
        bundle_of_one_name()  # as it was: what draws looks at it
    open_bundle()
