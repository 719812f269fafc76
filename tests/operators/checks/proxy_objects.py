"""What holds of the proxy's objects, their masks and their priors, checked inside Blender."""

import importlib
import json
import shutil
import time
from pathlib import Path

import bpy
import numpy as np
from proxy import group
from support import (
    BUNDLE,
    MODULE,
    OUT,
    bundle_of_one_name,
    calls,
    conduct,
    copied_bundle,
    open_bundle,
    open_here,
    refused,
)


def check_objects_are_listed_with_what_became_of_them():
    open_bundle()
    crate, lamp = group().objects
    assert (crate.name, crate.state, crate.masks, crate.shape) == ("crate", "aligned", 3, "box")
    assert abs(crate.iou - 0.95) < 1e-6 and abs(crate.residual_m - 0.01) < 1e-6
    assert (lamp.state, lamp.why) == ("refused", "it overlaps too little") and lamp.has_prior
    assert not crate.placed and not lamp.placed


def check_a_pose_held_by_hand_can_be_let_go():
    copy = copied_bundle()
    (copy / "objects" / "crate" / "placement.json").write_text('{"locked": false}', encoding="utf-8")
    open_bundle(copy)
    assert [one.placed for one in group().objects] == [True, False]


def check_masks_are_drawn_loaded_and_declared():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    assert bpy.ops.r2sego.new_object(name="my chair") == {"FINISHED"}
    assert group().objects[2].name == "my_chair" and group().object_index == 2
    assert "already" in refused(bpy.ops.r2sego.new_object, name="My_Chair")
    square = "10,20 30,20 30,40 10,40"
    assert bpy.ops.r2sego.draw_mask(points=square) == {"FINISHED"}  # in the scene's camera, capture_0
    assert bpy.ops.r2sego.draw_mask(capture="capture_1", points=square, tool="POLYGON") == {"FINISHED"}
    assert bpy.ops.r2sego.draw_mask(
        capture="capture_1", points="20,20 20,40", tool="BRUSH", radius=3.0, subtract=True
    ) == {"FINISHED"}
    assert group().objects[2].masks == 2
    image = bpy.data.images["my_chair in capture_0"]
    assert tuple(image.size) == (64, 48)
    pixels = np.array(image.pixels).reshape(48, 64, 4)[::-1, :, 0] > 0.5
    assert pixels.sum() == 400 and pixels[20:40, 10:30].all()
    for wrong in ("", "1,2 3,4", "a,b c,d e,f"):
        assert refused(bpy.ops.r2sego.draw_mask, points=wrong)
    assert "There is no capture 'attic'" in refused(bpy.ops.r2sego.draw_mask, points=square, capture="attic")
    assert bpy.ops.r2sego.paint_mask() == {"FINISHED"}
    assert bpy.ops.r2sego.load_masks() == {"FINISHED"}
    conduct("succeed")
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    (call,) = calls()
    assert call[:3] == ["objects", str(BUNDLE), "--masks"] and call[4:] == ["--json"]
    written = {file.relative_to(call[3]).as_posix() for file in Path(call[3]).rglob("*.png")}
    assert {"my_chair/capture_0.png", "my_chair/capture_1.png", "crate/capture_2.png"} <= written
    assert len(written) == 8
    again = bpy.data.images.load(str(Path(call[3]) / "my_chair" / "capture_1.png"))
    pixels = np.array(again.pixels).reshape(60, 80, -1)[::-1, :, 0]
    assert set(np.unique(pixels)) == {0.0, 1.0} and 240 < (pixels > 0.5).sum() < 400
    assert bpy.ops.r2sego.remove_object(name="crate") == {"FINISHED"}
    assert "crate" not in group().objects and "crate in capture_0" not in bpy.data.images


def check_points_that_are_no_numbers_are_refused():
    open_bundle()
    for points in ("nan,1 2,3 4,5", "1,2 3", "inf,1 2,3 4,5"):
        assert "are no points" in refused(bpy.ops.r2sego.draw_mask, capture="capture_0", points=points), points


def check_what_is_declared_stays_the_chosen_object():
    copy = copied_bundle()
    bpy.ops.r2sego.new_object(name="armchair")
    bpy.ops.r2sego.draw_mask(capture="capture_0", points="10,20 30,20 30,40 10,40")
    conduct("succeed")
    (copy / "objects" / "armchair" / "masks").mkdir(parents=True)  # as the engine leaves the bundle
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    assert [item.name for item in group().objects] == ["armchair", "crate", "lamp"]
    assert group().object_index == 0
    group().object_index = 2
    shutil.rmtree(copy / "objects" / "lamp")
    bpy.ops.r2sego.refresh_scene()
    assert group().object_index == 1


def drawn_pixels(image):
    """How many pixels of a mask are white."""
    return int((np.array(bpy.data.images[image].pixels).reshape(-1, 4)[:, 0] > 0.5).sum())


def check_masks_and_objects_stay_with_their_bundle():
    """Two bundles with captures of one name; the one is moved, and the .blend is saved meanwhile."""
    copy = copied_bundle()
    square = "10,20 30,20 30,40 10,40"
    assert bpy.ops.r2sego.new_object(name="chair") == {"FINISHED"}
    assert bpy.ops.r2sego.draw_mask(capture="capture_0", points=square) == {"FINISHED"}
    bpy.ops.r2sego.refresh_scene()
    assert "chair" in group().objects
    open_here(BUNDLE)
    assert "chair" not in group().objects and len(group().objects) == 2
    bpy.ops.r2sego.new_object(name="chair")
    bpy.ops.r2sego.draw_mask(capture="capture_0", points=square.replace("40", "25"))
    assert [drawn_pixels(name) for name in ("chair in capture_0", "chair in capture_0.001")] == [400, 100]
    conduct("succeed")
    bpy.ops.r2sego.declare_masks()
    written = bpy.data.images.load(str(Path(calls()[0][3]) / "chair" / "capture_0.png"))
    assert drawn_pixels(written.name) == 100
    open_here(copy)
    assert "chair" in group().objects and not group().objects["chair"].declared
    blend = copy.with_name("masks.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    moved = copy.rename(copy.with_name("moved_with_masks.r2s"))
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    open_here(moved)
    assert "chair" in group().objects
    bpy.ops.r2sego.remove_object(name="chair")
    assert "chair in capture_0" not in bpy.data.images and "chair in capture_0.001" in bpy.data.images


def check_a_mask_of_another_size_is_refused_and_loaded_anew():
    """As after Resize Image in the Image Editor."""
    open_bundle()
    bpy.ops.r2sego.show_priors()
    assert bpy.ops.r2sego.load_masks() == {"FINISHED"}
    before = drawn_pixels("crate in capture_0")
    bpy.data.images["crate in capture_0"].scale(32, 24)
    given = {"object_name": "crate", "capture": "capture_0", "points": "0,0 4,0 4,4"}
    for said in (refused(bpy.ops.r2sego.draw_mask, **given), refused(bpy.ops.r2sego.place_prior, object_name="crate")):
        assert "crate in capture_0: the mask is not of the capture's size" in said, said
        assert "64 by 48" in said and "Traceback" not in said, said
    assert bpy.ops.r2sego.load_masks() == {"FINISHED"}
    assert drawn_pixels("crate in capture_0") == before
    assert bpy.ops.r2sego.draw_mask(**given) == {"FINISHED"}


def check_the_first_stroke_on_a_declared_object_keeps_its_other_masks():
    open_bundle()
    corner = "0,0 4,0 4,4 0,4"
    assert bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points=corner) == {"FINISHED"}
    assert group().objects["crate"].masks == 3
    drawn = drawn_pixels("crate in capture_0")
    assert bpy.ops.r2sego.paint_mask(object_name="lamp", capture="capture_1") == {"FINISHED"}
    conduct("succeed")
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    folder = Path(calls()[0][3])
    for name, count in (("crate", 3), ("lamp", 3)):
        assert len(list((folder / name).glob("*.png"))) == count, name
    of_bundle = bpy.data.images.load(str(BUNDLE / "objects/crate/masks/capture_0.png"))
    assert 0 < drawn_pixels(of_bundle.name) < drawn


def check_declaring_and_a_rating_after_undo_leave_no_image_behind_blenders_history():
    """Blender crashes in an undo across images that no step of its history made."""
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    assert len(list(Path(calls()[0][3]).rglob("*.png"))) == 6 and len(bpy.data.images) == 0
    bpy.ops.r2sego.show_priors()
    bpy.ops.r2sego.place_prior(object_name="crate")
    rated = group().fit_iou
    assert len(bpy.data.images) == 3  # whose outlines are drawn
    for image in list(bpy.data.images):
        bpy.data.images.remove(image)
    group().fit_iou = 0.0
    importlib.import_module(f"{MODULE}.operators.proxy.place_prior").undone(bpy.context.scene)
    assert abs(group().fit_iou - rated) < 1e-6 and len(bpy.data.images) == 0


def check_the_last_object_is_taken_from_the_bundle():
    open_bundle()
    for name in ("crate", "lamp"):
        assert bpy.ops.r2sego.remove_object(name=name) == {"FINISHED"}
    assert len(group().objects) == 0 and not bpy.ops.r2sego.remove_object.poll()
    conduct("succeed")
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    assert calls() == [["objects", str(BUNDLE), "--json", "--remove=crate", "--remove=lamp"]]
    assert len(group().objects) == 2  # the stand-in engine took nothing away
    copy = copied_bundle()
    for name in ("crate", "lamp"):
        shutil.rmtree(copy / "objects" / name)  # as the engine leaves the bundle
    open_bundle(copy)
    assert len(group().objects) == 0 and not bpy.ops.r2sego.declare_masks.poll()


def check_a_removed_object_stays_removed_until_it_is_declared():
    open_bundle()
    bpy.ops.r2sego.remove_object(name="crate")
    bpy.ops.r2sego.refresh_scene()
    assert [item.name for item in group().objects] == ["lamp"]
    conduct("fail")
    refused(bpy.ops.r2sego.declare_masks)
    bpy.ops.r2sego.refresh_scene()
    assert "crate" not in group().objects  # what failed can be tried again
    conduct("succeed")
    assert bpy.ops.r2sego.declare_masks() == {"FINISHED"}
    assert {file.parent.name for file in Path(calls()[0][3]).rglob("*.png")} == {"lamp"}
    assert "crate" in group().objects  # the stand-in engine took nothing away
    bpy.ops.r2sego.remove_object(name="crate")
    bpy.ops.r2sego.new_object(name="crate")
    bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points="10,20 30,20 30,40 10,40")
    bpy.ops.r2sego.refresh_scene()
    assert not group().objects["crate"].declared and group().objects.find("crate") == 1  # another one
    conduct("succeed")
    bpy.ops.r2sego.declare_masks()
    assert len(list((Path(calls()[0][3]) / "crate").glob("*.png"))) == 1
    bpy.ops.r2sego.remove_object(name="crate")
    open_here(bundle_of_one_name())
    assert "crate" in group().objects


def check_a_prior_is_placed_by_hand_with_its_fit():
    copy = copied_bundle()
    assert bpy.ops.r2sego.show_priors() == {"FINISHED"}
    crate = bpy.data.objects["Prior crate"]
    assert "Refused" not in crate.data.materials[0].name
    assert "refused" in bpy.data.objects["Prior lamp"].data.materials[0].name
    assert bpy.ops.r2sego.place_prior(object_name="crate") == {"FINISHED"}
    assert group().fit_object == "crate" and group().fit_iou > 0.9, group().fit_iou
    assert group().fit_residual < 1e-3 and group().fit_views.startswith("capture_0\u00a00.9")
    crate.location.x += 0.3
    bpy.context.view_layer.update()  # the handler rates it again
    assert group().fit_iou < 0.8 and group().fit_residual > 0.02, group().fit_iou
    conduct("succeed")
    assert bpy.ops.r2sego.save_placement(object_name="crate", locked=False) == {"FINISHED"}
    (call,) = calls()
    assert call[:4] == ["objects", str(copy), "--json", "--place"] and call[4].startswith("crate=")
    placed = json.loads(Path(call[4].partition("=")[2]).read_text())
    assert placed["locked"] is False
    np.testing.assert_allclose(placed["world_from_own"], np.array(crate.matrix_world))
    lock = bpy.ops.r2sego.save_placement.get_rna_type().properties["locked"]
    assert lock.default and lock.is_skip_save  # the panel does not show it: Save means Lock
    crate.scale.x *= 2.0
    assert "not stretched" in refused(bpy.ops.r2sego.save_placement, object_name="crate")
    assert "There is no object 'sofa'" in refused(bpy.ops.r2sego.place_prior, object_name="sofa")
    bpy.data.objects.remove(crate)
    assert "Press Show Priors" in refused(bpy.ops.r2sego.place_prior, object_name="crate")
    shutil.rmtree(copy / "geometry" / "priors")  # as where Refine has not run yet
    bpy.ops.r2sego.refresh_scene()
    assert "Run Refine" in refused(bpy.ops.r2sego.place_prior, object_name="crate")


def check_a_hidden_prior_is_not_placed_but_told():
    open_bundle()
    bpy.ops.r2sego.show_priors()
    (priors,) = bpy.data.objects["Prior crate"].users_collection
    room = bpy.context.view_layer.layer_collection.children["room"]
    hideable = room.children[priors.name]
    for hide, show in (
        (lambda: setattr(hideable, "exclude", True), lambda: setattr(hideable, "exclude", False)),
        (lambda: setattr(priors, "hide_viewport", True), lambda: setattr(priors, "hide_viewport", False)),
    ):
        hide()
        said = refused(bpy.ops.r2sego.place_prior, object_name="crate")
        assert "'Prior crate' is hidden. Show it and its collection in the Outliner" in said, said
        assert group().fit_object == ""
        # Blender keeps the pose of before: saving it would be wrong.
        bpy.data.objects["Prior crate"].location.x += 0.3
        said = refused(bpy.ops.r2sego.save_placement, object_name="crate")
        assert "'Prior crate' is hidden" in said, said
        show()
    assert bpy.ops.r2sego.place_prior(object_name="crate") == {"FINISHED"}


def check_a_mask_drawn_anew_is_rated_at_once():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_priors()
    bpy.ops.r2sego.place_prior(object_name="crate")
    before = group().fit_iou
    whole = "0,0 64,0 64,48 0,48"
    assert bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points=whole) == {"FINISHED"}
    assert group().fit_iou < before - 0.1
    assert bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points=whole, subtract=True) == {
        "FINISHED"
    }
    assert "capture_0" not in group().fit_views and group().fit_iou > 0.9


def check_undo_takes_the_fit_and_the_outlines_back():
    live = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.proxy.placement_live")
    open_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_priors()
    bpy.ops.r2sego.place_prior(object_name="crate")
    bpy.data.objects["Prior crate"].name = "A crate"
    bpy.ops.ed.undo_push(message="placed")

    def crate():
        return bpy.data.objects["A crate"]

    before, outline = group().fit_iou, live.mask_outline(str(BUNDLE), "crate", "capture_0")
    whole = "0,0 64,0 64,48 0,48"
    bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points=whole)
    assert group().fit_iou < before - 0.1
    drawn = live.mask_outline(str(BUNDLE), "crate", "capture_0")
    assert len(drawn) != len(outline)
    bpy.ops.ed.undo_push(message="drawn")
    bpy.ops.ed.undo()
    assert live.followed(crate()) and abs(group().fit_iou - before) < 1e-6
    assert abs(live.rated(crate())[0].iou - before) < 1e-6
    assert len(live.mask_outline(str(BUNDLE), "crate", "capture_0")) == len(outline)
    less = "0,0 32,0 32,48 0,48"
    bpy.ops.r2sego.draw_mask(object_name="crate", capture="capture_0", points=less)
    assert len(live.mask_outline(str(BUNDLE), "crate", "capture_0")) not in (len(outline), len(drawn))


def check_a_mesh_library_is_chosen_and_withdrawn():
    copy, library = copied_bundle(), OUT.parent / "mesh library"
    assert group().library == ""
    conduct("succeed")
    assert "no folder of meshes is chosen" in refused(bpy.ops.r2sego.choose_mesh_library).lower()
    assert bpy.ops.r2sego.choose_mesh_library(directory=str(library)) == {"FINISHED"}
    assert calls() == [["objects", str(copy), "--json", "--library", str(library)]]
    declared = copy / "scene.toml"
    text = declared.read_text(encoding="utf-8").replace('mesh_library = ""', 'mesh_library = "/meshes/of a house"')
    declared.write_text(text, encoding="utf-8")
    bpy.ops.r2sego.refresh_scene()
    assert group().library == "/meshes/of a house"
    conduct("succeed")
    assert bpy.ops.r2sego.choose_mesh_library(withdraw=True) == {"FINISHED"}
    assert calls() == [["objects", str(copy), "--json", "--no-library"]]


def check_a_prior_scaled_to_nothing_has_no_residual():
    """As for a moment while a person types 0.9."""
    live = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.proxy.placement_live")
    open_bundle()
    bpy.ops.r2sego.show_priors()
    assert bpy.ops.r2sego.place_prior(object_name="crate") == {"FINISHED"}
    crate = bpy.data.objects["Prior crate"]
    assert np.isfinite(live.rated(crate)[1])
    crate.scale = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    fit, residual_m = live.rated(crate)
    assert np.isnan(residual_m) and fit.iou < 0.5
    assert bpy.ops.r2sego.place_prior(object_name="crate") == {"FINISHED"}


def check_a_placed_prior_is_followed_in_an_opened_file_and_in_every_scene():
    live = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.proxy.placement_live")
    open_bundle()
    bpy.ops.r2sego.show_priors()
    bpy.ops.r2sego.place_prior(object_name="crate")
    blend = OUT.parent / "placed.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert live.followed(bpy.data.objects["Prior crate"])  # its outlines are drawn at once

    def follows(name):
        before = group().fit_iou
        bpy.data.objects[name].location.x += 0.1
        bpy.context.view_layer.update()
        return group().fit_object == "crate" and group().fit_iou < before - 0.02

    first = bpy.context.scene
    assert follows("Prior crate")
    told = group().fit_iou
    assert bpy.ops.scene.new(type="FULL_COPY") == {"FINISHED"} and bpy.context.scene != first
    assert follows("Prior crate.001") and abs(first.r2sego_proxy.fit_iou - told) < 1e-6
    bpy.context.window.scene = first
    assert follows("Prior crate")
    name = first.name
    bpy.context.window.scene = bpy.data.scenes.new("Empty")
    bpy.ops.ed.undo_push(message="elsewhere")
    bpy.ops.ed.undo_push(message="elsewhere too")
    bpy.ops.ed.undo()
    bpy.context.window.scene = bpy.data.scenes[name]
    assert follows("Prior crate")


def check_a_rating_follows_the_mouse():
    open_bundle()
    bpy.ops.r2sego.show_priors()
    bpy.ops.r2sego.place_prior(object_name="crate")
    crate = bpy.data.objects["Prior crate"]
    started_s = time.process_time()
    for _ in range(10):
        crate.location.x += 0.01
        bpy.context.view_layer.update()
    assert (time.process_time() - started_s) / 10 < 0.5


def check_decisions_and_meshes_go_to_the_engine():
    open_bundle()
    for decision in ("accept", "reject", "reconsider", "lock", "unlock"):
        conduct("succeed")
        assert bpy.ops.r2sego.decide_prior(object_name="lamp", decision=decision) == {"FINISHED"}
        assert calls() == [["objects", str(BUNDLE), "--json", f"--{decision}", "lamp"]]
    given = bpy.context.window_manager.operator_properties_last("r2sego.decide_prior")
    for given.decision, told in (("accept", "Take the prior"), ("unlock", "Align it again")):
        assert bpy.types.R2SEGO_OT_decide_prior.description(bpy.context, given).startswith(told)
    mesh = bpy.data.meshes.new("stand")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    stand = bpy.data.objects.new("stand", mesh)
    bpy.context.scene.collection.objects.link(stand)
    stand.location.z = 2.0
    bpy.context.view_layer.update()
    conduct("succeed")
    assert bpy.ops.r2sego.use_mesh_as_prior(object_name="lamp", mesh="stand", place="LOCK") == {"FINISHED"}
    (call,) = calls()
    assert call[3] == "--mesh" and call[5] == "--place"
    obj = Path(call[4].partition("=")[2]).read_text().splitlines()
    assert obj[:2] == ["v 0 0 2", "v 1 0 2"] and obj[3] == "f 1 2 3"
    placed = json.loads(Path(call[6].partition("=")[2]).read_text())
    assert placed == {"world_from_own": np.eye(4).tolist(), "locked": True}
    stand.name = "\u6905\u5b50"
    conduct("succeed")
    assert bpy.ops.r2sego.use_mesh_as_prior(object_name="lamp", mesh=stand.name) == {"FINISHED"}
    assert Path(calls()[0][4].partition("=")[2]).suffix == ".obj"
