"""What holds of the room Collision, checked inside Blender."""

import os
import sys
from types import SimpleNamespace

import addon_utils
import bpy
from support import BUNDLE, MODULE, OUT, calls, conduct, copied_bundle, open_bundle

OPERATORS = {"check_collision", "export_collision", "show_collision", "texture_proxy"}


def check_show_collision():
    open_bundle()
    assert bpy.ops.r2sego.show_collision() == {"FINISHED"}


def check_a_shown_surface_that_was_redone_since_is_told():
    copy = copied_bundle()
    group = bpy.context.scene.r2sego_collision
    bpy.ops.r2sego.show_collision()
    bpy.ops.r2sego.refresh_scene()
    assert not group.older
    os.utime(copy / "collision" / "mesh.obj", (1, 1))
    bpy.ops.r2sego.refresh_scene()
    assert group.older
    bpy.ops.r2sego.show_collision()
    assert not group.older


def check_exporting_asks_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.export_collision(directory="/out") == {"FINISHED"}
    assert calls() == [["export", str(BUNDLE), "--to", "/out", "--json-progress"]]


def check_checking_asks_mujoco_and_keeps_its_figures():
    open_bundle()
    conduct("succeed")
    group = bpy.context.scene.r2sego_collision
    assert bpy.ops.r2sego.check_collision() == {"FINISHED"}
    assert calls() == [["check-collision", str(BUNDLE), "--json-progress"]]
    assert group.checked and not group.passed  # the stand-in says nothing of it
    checked = sys.modules[f"{MODULE}.operators.collision.check_collision"]
    figures = {
        "pieces": 12,
        "vertex_error_m": 2e-6,
        "spheres": 40,
        "at_rest": 39,
        "fell_through": 1,
        "rest_within_1_cm": 38,
        "robot_stands": False,
        "robot_failure": "fall: it tipped over",
        "off_surface": _OFF_SURFACE,
    }
    assert checked._facts(figures) == [
        ("Pieces", "12, exact to 0.002 mm"),
        ("Spheres", "39 of 40 at rest, 1 fell through"),
        ("Within 1 cm", "38 of 40"),
        ("Farthest", "2.2 cm off"),
        ("Robot", "fall: it tipped over"),
    ]
    stands = checked._facts({"robot_stands": True, "robot_pelvis_offset_m": 0.012})
    assert stands == [("Robot", "stands, within 1.2 cm")]


_OFF_SURFACE = [
    {"what": "fell through", "place_m": [0.5, 0.0, 1.8], "gap_m": None, "spheres": 1},
    {"what": "floats", "place_m": [1.0, -2.0, 0.5], "gap_m": 0.0224, "spheres": 2},
]


def check_spheres_off_the_surface_are_marked_till_the_next_check_or_surface():
    copy = copied_bundle()
    conduct("succeed")
    bpy.ops.r2sego.check_collision()
    operator = sys.modules[f"{MODULE}.operators.collision.check_collision"].R2SEGO_OT_check_collision
    for _ in range(2):
        told = operator.finish(None, bpy.context, {"passed": False, "off_surface": _OFF_SURFACE})
        fell, floats = sorted((one for one in bpy.data.objects if one.type == "EMPTY"), key=lambda one: one.name)
    assert told == "The collision surface did not pass; spheres off it are marked at 2 places"
    assert (fell.name, floats.name) == ("Sphere fell through", "Sphere floats by 2.2 cm")
    assert tuple(floats.location) == (1.0, -2.0, 0.5) and abs(floats.empty_display_size - 0.05) < 1e-6
    bpy.ops.ed.undo_push(message="marked")
    bpy.context.scene.frame_current += 1
    bpy.ops.ed.undo_push(message="something else")
    os.utime(copy / "collision" / "mesh.obj", (1, 1))
    bpy.ops.r2sego.refresh_scene()
    assert not [one for one in bpy.data.objects if one.type == "EMPTY"]
    bpy.ops.ed.undo_push(message="refreshed")
    for _ in range(2):
        bpy.ops.ed.undo()  # which must not remove what its own steps have
        marks = [one for one in bpy.data.objects if one.type == "EMPTY"]
        assert len(marks) == 2 and all(one.users_collection for one in marks)
        assert not bpy.context.scene.r2sego_collision.checked
    bpy.ops.r2sego.refresh_scene()
    operator.finish(None, bpy.context, {"passed": False, "off_surface": _OFF_SURFACE})
    assert operator.finish(None, bpy.context, {"passed": True, "off_surface": []}).endswith("passed")
    assert not [one for one in bpy.data.objects if one.type == "EMPTY"]


def check_another_surface_forgets_the_check():
    copy = copied_bundle()
    conduct("succeed")
    bpy.ops.r2sego.check_collision()
    group = bpy.context.scene.r2sego_collision
    assert group.checked
    os.utime(copy / "collision" / "mesh.obj", (1, 1))
    bpy.ops.r2sego.refresh_scene()
    assert not group.checked


def check_the_lines_of_a_texture_stay_while_the_proxy_is_the_same():
    copy = copied_bundle()
    texture_proxy = sys.modules[f"{MODULE}.operators.collision.texture_proxy"]
    told = {
        "file": "/out/a.glb",
        "megabytes": 1.0,
        "faces": 13,
        "size_px": 64,
        "seen": 0.5,
        "psnr_db": 20.0,
        "covered": 0.5,
    }
    operator = SimpleNamespace(show=False)
    texture_proxy.R2SEGO_OT_texture_proxy.finish(operator, bpy.context, told)
    group = bpy.context.scene.r2sego_collision
    bpy.ops.r2sego.refresh_scene()
    assert [line.name for line in group.texture] == ["Textured", "Seen", "Captures"]
    os.utime(copy / "rounds" / "1" / "proxy" / "proxy.npz", (1, 1))
    bpy.ops.r2sego.refresh_scene()
    assert not group.texture


def check_an_importer_that_is_switched_off_is_told():
    open_bundle()
    showing = sys.modules[f"{MODULE}.r2sego_blender.bridge.collision.show_collision"]
    errors = sys.modules[f"{MODULE}.r2sego_blender.core.errors"]
    bundle = sys.modules[f"{MODULE}.r2sego_blender.results.panels.bundle"].Bundle.open(BUNDLE)
    addon_utils.disable("io_scene_gltf2")
    try:
        showing.show_textured(bpy.context.scene, bundle, OUT.parent / "textured.glb")
    except errors.SceneError as error:
        assert "glTF is switched off" in str(error) and "add-on" in error.cure
    else:
        raise AssertionError("nothing was told")
    finally:
        addon_utils.enable("io_scene_gltf2")


def check_texturing_and_formats_are_asked_of_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.texture_proxy(faces=5000, size=512, filepath="/out/room.glb") == {"FINISHED"}
    files = {"splats": {".spz", ".glb"}, "textured": True}
    assert bpy.ops.r2sego.export_collision(directory="/out", **files) == {"FINISHED"}
    textured, exported = calls()
    assert textured == [
        "texture",
        str(BUNDLE),
        "--faces",
        "5000",
        "--size",
        "512",
        "--json-progress",
        "--to",
        "/out/room.glb",
    ]
    assert exported == ["export", str(BUNDLE), "--to", "/out", "--json-progress", "--splats", ".spz,.glb", "--textured"]


def check_a_textured_mesh_stands_where_the_proxy_does():
    open_bundle()
    mesh = bpy.data.meshes.new("tall")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 0, 3)], [], [(0, 1, 2)])
    tall = bpy.data.objects.new("tall", mesh)
    bpy.context.scene.collection.objects.link(tall)
    mesh.uv_layers.new()
    painted = bpy.data.materials.new("painted")
    painted.use_nodes = True
    image = painted.node_tree.nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.new("paint", 4, 4)
    shader = painted.node_tree.nodes["Principled BSDF"]
    painted.node_tree.links.new(image.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.append(painted)
    file = OUT.parent / "textured.glb"
    bpy.ops.export_scene.gltf(filepath=str(file), export_format="GLB")
    bpy.data.batch_remove([tall, mesh, painted, image.image])
    there = len(bpy.data.materials), len(bpy.data.images)
    showing = sys.modules[f"{MODULE}.r2sego_blender.bridge.collision.show_collision"]
    bundle = sys.modules[f"{MODULE}.r2sego_blender.results.panels.bundle"].Bundle.open(BUNDLE)
    for _ in range(2):
        (shown,) = showing.show_textured(bpy.context.scene, bundle, file)
    bpy.context.view_layer.update()
    top = max((shown.matrix_world @ vertex.co).z for vertex in shown.data.vertices)
    assert abs(top - 3.0) < 1e-5
    assert len([one for one in bpy.data.objects if one.type == "MESH"]) == 1
    # What was shown before has left nothing behind.
    assert (len(bpy.data.materials), len(bpy.data.images)) == (there[0] + 1, there[1] + 1)
