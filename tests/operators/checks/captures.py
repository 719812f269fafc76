"""What holds of the room Captures, checked inside Blender."""

import importlib
import json
import re
from pathlib import Path
from types import SimpleNamespace

import bpy
from support import (
    BUNDLE,
    MODULE,
    bundle_of_one_name,
    calls,
    conduct,
    copied_bundle,
    open_bundle,
    open_here,
    refused,
    state,
)

OPERATORS = {
    "import_captures",
    "look_through",
    "look_through_next",
    "pick_point",
    "remove_pick",
    "add_length",
    "remove_length",
    "place_frame",
    "correct_registration",
    "undo_correction",
}
SPOTS = {"A": (-0.4, 0.2, 0.0), "B": (0.5, 0.1, 0.0), "C": (0.1, 0.7, 0.0)}


def shown():
    return bpy.context.scene.r2sego_captures


def described():
    return json.loads((BUNDLE / "captures" / "cameras.json").read_text())["captures"]


def seen_at(lens, spot):
    """The pixel at which a capture sees a point of the world, by the conventions."""
    from mathutils import Matrix, Vector

    local = Matrix(lens["world_from_camera"]).inverted() @ Vector((*spot, 1.0))
    return lens["fx"] * local.x / local.z + lens["cx"], lens["fy"] * local.y / local.z + lens["cy"]


def pick_all(floor=True):
    """Pick SPOTS in every capture that sees them."""
    for name, spot in SPOTS.items():
        for lens in described():
            x, y = seen_at(lens, spot)
            if 0 <= x <= lens["width"] and 0 <= y <= lens["height"]:
                done = bpy.ops.r2sego.pick_point(point=name, capture=lens["name"], x_px=x, y_px=y, floor=floor)
                assert done == {"FINISHED"}


def check_import_captures():
    open_bundle()
    assert bpy.ops.r2sego.import_captures(points=True) == {"FINISHED"}
    assert [c.name for c in sorted(bpy.data.objects, key=lambda o: o.name) if c.type == "CAMERA"] == [
        "capture_0",
        "capture_1",
        "capture_2",
    ]
    bpy.context.view_layer.objects.active = bpy.data.objects["capture_2"]
    assert bpy.ops.r2sego.look_through() == {"FINISHED"}
    render = bpy.context.scene.render
    assert (render.resolution_x, render.resolution_y) == (60, 80)
    assert abs(render.pixel_aspect_x - 66.5 / 52.0) < 1e-6


def check_a_capture_sees_a_point_at_its_pixel():
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    open_bundle()
    bpy.ops.r2sego.import_captures()
    for lens in described():
        seen_from = bpy.data.objects[lens["name"]]
        bpy.context.view_layer.objects.active = seen_from
        bpy.ops.r2sego.look_through()
        bpy.context.view_layer.update()
        local = Vector((0.3, -0.2, 2.0, 1.0))
        rows = [Vector(row) for row in lens["world_from_camera"]]
        point = Vector([row @ local for row in rows[:3]])
        x, y, depth = world_to_camera_view(bpy.context.scene, seen_from, point)
        assert abs(x * lens["width"] - (lens["fx"] * 0.15 + lens["cx"])) < 1e-3
        assert abs((1.0 - y) * lens["height"] - (lens["cy"] - lens["fy"] * 0.1)) < 1e-3
        assert abs(depth - 2.0) < 1e-5


def check_the_list_says_what_each_capture_is():
    open_bundle()
    listed = [(one.name, one.width, one.height, one.points, one.overlaps) for one in shown().captures]
    assert listed == [("capture_0", 64, 48, 50, 2), ("capture_1", 80, 60, 50, 2), ("capture_2", 60, 80, 50, 2)]
    assert abs(shown().captures[0].view_deg - 65.2) < 0.1


def check_a_line_of_the_list_selects_its_camera():
    open_bundle()
    shown().active_capture = 1  # nothing is imported yet: no harm
    bpy.ops.r2sego.import_captures()
    shown().active_capture = 2
    assert bpy.context.view_layer.objects.active.name == "capture_2"
    assert [one.name for one in bpy.context.selected_objects] == ["capture_2"]
    bpy.data.objects["capture_1"].hide_set(True)
    shown().active_capture = 1  # nobody can select it, so what is selected stays
    assert bpy.context.view_layer.objects.active.name == "capture_2"
    assert [one.name for one in bpy.context.selected_objects] == ["capture_2"]


def check_what_becomes_active_leaves_no_other_object_in_edit_mode():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.show_asset()
    bpy.ops.mesh.primitive_plane_add()
    edited = bpy.context.object
    for number, choose in enumerate(
        (
            lambda: setattr(shown(), "active_capture", 1),
            bpy.ops.r2sego.look_through_next,
            bpy.ops.r2sego.place_frame,
            bpy.ops.r2sego.add_splat_box,
        )
    ):
        bpy.context.view_layer.objects.active = edited
        bpy.ops.object.mode_set(mode="EDIT")
        choose()
        assert bpy.context.view_layer.objects.active != edited and edited.mode == "OBJECT", number


def check_one_capture_after_the_other_is_looked_through():
    open_bundle()
    assert "Import" in refused(bpy.ops.r2sego.look_through_next)
    bpy.ops.r2sego.import_captures()
    seen = []
    for backwards in (False, False, False, True):
        assert bpy.ops.r2sego.look_through_next(backwards=backwards) == {"FINISHED"}
        seen.append(bpy.context.scene.camera.name)
    assert seen == ["capture_1", "capture_2", "capture_0", "capture_2"]
    assert bpy.context.scene.render.resolution_y == 80
    shown().active_capture = 1
    bpy.context.view_layer.objects.active = None
    assert bpy.ops.r2sego.look_through() == {"FINISHED"}  # through the list's capture
    assert bpy.context.scene.camera.name == "capture_1"


def check_a_view_with_a_camera_of_its_own_looks_through_the_capture_too():
    """As one in Local View does, which keeps its camera of before."""
    open_bundle()
    bpy.ops.r2sego.import_captures()
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    looks_through = importlib.import_module(
        f"{MODULE}.r2sego_blender.bridge.shared.views_3d"
    ).looks_through_scene_camera
    view = area.spaces.active
    view.use_local_camera, view.camera = True, bpy.data.objects["capture_0"]
    with bpy.context.temp_override(area=area, region=region):
        assert bpy.ops.r2sego.look_through_next() == {"FINISHED"}
        assert view.camera == bpy.context.scene.camera == bpy.data.objects["capture_1"]
        assert looks_through(bpy.context)
        view.use_local_camera, view.camera = True, bpy.data.objects["capture_0"]
        assert not looks_through(bpy.context)
    view.use_local_camera = False


def check_a_bundle_written_with_a_slash_at_its_end_is_the_same():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    state().bundle = f"{BUNDLE}/"
    assert bpy.ops.r2sego.look_through_next() == {"FINISHED"}
    assert bpy.ops.r2sego.import_captures() == {"FINISHED"}
    assert len([one for one in bpy.data.objects if one.type == "CAMERA"]) == 3


def check_two_bundles_of_one_name_are_shown_side_by_side():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    first = [one.name for one in bpy.data.objects]
    open_here(bundle_of_one_name())
    bpy.ops.r2sego.import_captures()
    assert len(bpy.data.objects) == 2 * len(first) and all(name in bpy.data.objects for name in first)


def check_all_photographs_are_switched_and_faded_at_once():
    open_bundle()
    bpy.ops.r2sego.import_captures(photographs=False)
    cameras = [one.data for one in bpy.data.objects if one.type == "CAMERA"]
    assert not shown().show_photographs and not any(one.background_images for one in cameras)
    shown().show_photographs = True
    shown().photograph_opacity = 0.25
    assert [round(one.background_images[0].alpha, 6) for one in cameras] == [0.25] * 3
    assert all(one.show_background_images for one in cameras)
    shown().show_photographs = False
    assert not any(one.show_background_images for one in cameras)


def check_picked_points_are_placed_with_their_residuals():
    open_bundle()
    pick_all()
    assert shown().fit_problem == ""
    for point in shown().points:
        placed = point.placed
        assert 0.0 <= placed.off_px < 1e-3 and abs(placed.off_floor_m) < 1e-4
        assert max(abs(a - b) for a, b in zip(placed.position, SPOTS[point.name], strict=True)) < 1e-4
    assert bpy.ops.r2sego.add_length(start="A", end="B", metres=1.8111) == {"FINISHED"}
    assert abs(shown().lengths[0].error_m) < 1e-5
    assert "a metre becomes 2 m" in shown().fit_said
    view = shown().points["A"].views[0]
    bpy.ops.r2sego.pick_point(point="A", capture=view.capture, x_px=view.x_px + 0.4, y_px=view.y_px)
    assert shown().points["A"].placed.off_px > 0.05 and len(shown().points) == 3


def check_the_dialog_of_a_length_proposes_the_points_picked_last():
    """Not the pair of the time before, whose length it would replace."""
    properties = bpy.ops.r2sego.add_length.get_rna_type().properties
    assert properties["start"].is_skip_save and properties["end"].is_skip_save
    assert not properties["metres"].is_skip_save


def check_lengths_follow_a_point_that_is_renamed():
    open_bundle()
    pick_all()
    bpy.ops.r2sego.add_length(start="A", end="B", metres=1.0)
    bpy.ops.r2sego.add_length(start="C", end="A", metres=2.0)
    shown().points["A"].name = "corner"
    assert [(one.start, one.end) for one in shown().lengths] == [("corner", "B"), ("C", "corner")]
    assert all(one.error_m is not None for one in shown().lengths) and shown().points["corner"].placed
    for taken in ("B", ""):
        shown().points["corner"].name = taken
        assert sorted(one.name for one in shown().points) == ["A", "B", "C"], taken
        assert [(one.start, one.end) for one in shown().lengths] == [("A", "B"), ("C", "A")]
        shown().points["A"].name = "corner"


def check_picks_stay_with_their_bundle():
    copy = copied_bundle()
    pick_all()
    bpy.ops.r2sego.add_length(start="A", end="B", metres=1.0)
    shown().use_camera_height, shown().camera_height = True, 1.25
    shown().height_capture = "capture_1"
    shown().active_capture = 2
    open_here(copy)  # again
    bpy.ops.r2sego.refresh_scene()
    assert len(shown().points) == 3 and len(shown().lengths) == 1 and shown().use_camera_height
    open_here(copy.rename(copy.with_name("moved_with_picks.r2s")))  # it only moved
    assert len(shown().points) == 3 and shown().lengths[0].end == "B" and shown().active_capture == 2
    open_here(BUNDLE)
    assert not len(shown().points) and not len(shown().lengths) and not shown().use_camera_height
    assert (shown().height_capture, shown().active_capture) == ("capture_0", 0)
    assert shown().fit_problem == shown().fit_said == ""


def check_a_capture_of_another_bundle_is_not_looked_through():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    open_here(bundle_of_one_name())
    assert bpy.ops.r2sego.new_object(name="chair") == {"FINISHED"}
    square = "10,20 30,20 30,40 10,40"
    assert "No capture is looked through" in refused(bpy.ops.r2sego.draw_mask, points=square)
    bpy.ops.r2sego.import_captures()
    assert bpy.ops.r2sego.draw_mask(points=square) == {"FINISHED"}


def check_wrong_picks_are_told_before_anything_is_moved():
    open_bundle()
    pick_all()
    view = shown().points["B"].views[0]
    bpy.ops.r2sego.pick_point(point="B", capture=view.capture, x_px=view.x_px - 9, y_px=view.y_px)
    assert "do not show one point 'B'" in shown().fit_problem
    assert "outside" in refused(bpy.ops.r2sego.pick_point, capture="capture_0", x_px=65, y_px=1)
    assert "no capture 'x'" in refused(bpy.ops.r2sego.pick_point, capture="x", x_px=1, y_px=1)
    assert "is none" in refused(bpy.ops.r2sego.add_length, start="A", end="Z")


def check_points_and_lengths_are_taken_away():
    open_bundle()
    pick_all()
    bpy.ops.r2sego.add_length(start="A", end="B", metres=1.0)
    bpy.ops.r2sego.add_length(start="C", end="B", metres=1.0)
    assert bpy.ops.r2sego.remove_pick(point="A") == {"FINISHED"}
    assert [one.name for one in shown().points] == ["B", "C"] and len(shown().lengths) == 1
    capture = shown().points["B"].views[0].capture
    count = len(shown().points["B"].views)
    assert bpy.ops.r2sego.remove_pick(point="B", capture=capture) == {"FINISHED"}
    assert len(shown().points["B"].views) == count - 1
    assert bpy.ops.r2sego.remove_length(index=0) == {"FINISHED"}
    assert bpy.ops.r2sego.remove_pick(everything=True) == {"FINISHED"}
    assert not len(shown().points)
    assert "No point is picked yet" in refused(bpy.ops.r2sego.remove_pick)
    pick_all()
    assert bpy.ops.r2sego.remove_pick("EXEC_DEFAULT", True) == {"FINISHED"}  # as pressed: it remembers
    assert len(shown().points) == 2


def check_new_points_get_names_of_their_own():
    open_bundle()
    for _ in range(2):
        bpy.ops.r2sego.pick_point(capture="capture_0", x_px=10, y_px=10)
    assert [one.name for one in shown().points] == ["A", "B"]


def check_correcting_by_picks_asks_the_engine_with_a_file_of_them():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    assert "Nothing tells" in refused(bpy.ops.r2sego.correct_registration)
    pick_all()
    shown().use_camera_height = True
    shown().camera_height = 1.25
    conduct("succeed")
    assert bpy.ops.r2sego.correct_registration() == {"FINISHED"}
    (call,) = calls()
    assert call[:4] == ["register", str(BUNDLE), "--json-progress", "--picks"]
    told = json.loads(Path(call[4]).read_text(encoding="utf-8"))
    assert [point["name"] for point in told["points"]] == ["A", "B", "C"]
    assert all(point["floor"] for point in told["points"])
    assert told["camera_heights"] == [{"capture": "capture_0", "metres": 1.25}]
    assert len([one for one in bpy.data.objects if one.type == "CAMERA"]) == 3  # shown again


def check_the_arrows_become_the_world():
    open_bundle()
    bpy.ops.r2sego.import_captures(points=True)
    assert "no frame" in refused(bpy.ops.r2sego.correct_registration, by="FRAME")
    assert bpy.ops.r2sego.place_frame() == {"FINISHED"}
    frame = bpy.context.view_layer.objects.active
    frame.location, frame.rotation_euler.z = (0.5, -0.25, 0.1), 0.3
    conduct("succeed")
    assert bpy.ops.r2sego.correct_registration(by="FRAME") == {"FINISHED"}
    (call,) = calls()
    numbers = [float(number) for number in call[4].split(",")]
    assert call[3] == "--frame" and len(numbers) == 12
    assert abs(numbers[0] - 0.9553365) < 1e-6 and abs(numbers[7] + 0.25) < 1e-6
    assert "World Frame" not in bpy.data.objects  # the world is there now
    assert "Sparse points" in bpy.data.objects


def check_cameras_that_a_view_does_not_show_have_no_label():
    open_bundle()
    bpy.ops.r2sego.import_captures()
    cameras = sorted((one for one in bpy.data.objects if one.type == "CAMERA"), key=lambda one: one.name)
    (captures,) = cameras[0].users_collection
    labels = importlib.import_module(f"{MODULE}.panels.overlays.picture_labels")
    space = next(a for a in bpy.context.screen.areas if a.type == "VIEW_3D").spaces.active
    context = SimpleNamespace(scene=bpy.context.scene, space_data=space)

    def labelled():
        bpy.context.view_layer.update()
        return sorted(camera.name for camera in labels.labelled(context))

    assert labelled() == [camera.name for camera in cameras]
    cameras[0].hide_set(True)
    cameras[1].hide_viewport = True
    assert labelled() == [cameras[2].name]
    space.show_object_viewport_camera = False
    assert labelled() == []
    space.show_object_viewport_camera = True
    captures.hide_viewport = True
    assert labelled() == []


def check_arrows_in_a_hidden_collection_are_placed_all_the_same():
    open_bundle()
    bpy.ops.r2sego.place_frame()
    (arrows,) = bpy.data.objects["World Frame"].users_collection
    bpy.context.view_layer.layer_collection.children["room"].children[arrows.name].exclude = True
    assert bpy.ops.r2sego.place_frame() == {"FINISHED"}
    assert "World Frame" in bpy.data.objects and bpy.context.view_layer.objects.active is None


def check_what_stands_in_the_world_before_its_correction_is_told():
    copy = copied_bundle()
    bpy.ops.r2sego.import_captures()
    bpy.ops.r2sego.place_frame()
    bpy.ops.r2sego.refresh_scene()
    assert not shown().older
    declared = (copy / "scene.toml").read_text(encoding="utf-8")
    moved = re.sub(r"(world_from_capture = \[\s*\[[^]]*?)0\.0(,?\s*\])", r"\g<1>0.5\2", declared)
    assert moved != declared
    (copy / "scene.toml").write_text(moved, encoding="utf-8")
    bpy.ops.r2sego.refresh_scene()
    assert shown().older
    assert "corrected since this frame was placed" in refused(bpy.ops.r2sego.correct_registration, by="FRAME")
    bpy.ops.r2sego.import_captures()
    assert not shown().older


def check_a_correction_is_taken_back_when_there_is_one():
    open_bundle()
    assert "no correction" in refused(bpy.ops.r2sego.undo_correction)
    folder = copied_bundle()
    eye = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    one = {"new_from_old": eye, "world_from_capture": eye, "ground": "g", "scale_source": "s"}
    (folder / "corrections.json").write_text(json.dumps([one]))
    bpy.ops.r2sego.refresh_scene()
    assert shown().corrections == 1
    conduct("succeed")
    assert bpy.ops.r2sego.undo_correction() == {"FINISHED"}
    assert calls()[0] == ["register", str(folder), "--json-progress", "--undo"]
    (folder / "corrections.json").write_text("{")
    bpy.ops.r2sego.refresh_scene()
    assert "corrections.json" in state().problem


def check_nothing_of_the_rooms_is_left_when_the_addon_is_disabled():
    import addon_utils

    open_bundle()
    addon_utils.disable(MODULE, default_set=False)
    try:
        handlers = [one for one in bpy.types.FileHandler.__subclasses__() if "R2SEGO" in one.__name__]
        assert not any(one.is_registered for one in handlers)
        assert not hasattr(bpy.types.Scene, "r2sego_captures")
        assert not hasattr(bpy.types.Scene, "r2sego_report")
    finally:
        addon_utils.enable(MODULE, default_set=False)
    open_bundle()
    assert len(shown().captures) == 3
