"""What holds of the room Proxy, checked inside Blender."""

import os
import time
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Matrix
from support import (
    BUNDLE,
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

OPERATORS = {
    "show_proxy",
    "measure_coverage",
    "select_proxy_lasso",
    "select_proxy_box",
    "cut_proxy",
    "draw_proxy_surface",
    "remove_proxy_edit",
    "new_object",
    "remove_object",
    "draw_mask",
    "paint_mask",
    "load_masks",
    "declare_masks",
    "show_priors",
    "place_prior",
    "save_placement",
    "use_mesh_as_prior",
    "decide_prior",
    "choose_mesh_library",
    "plan_refine",
}


def group():
    return bpy.context.scene.r2sego_proxy


def shown():
    """The proxy of round 0, shown."""
    open_bundle()
    state().round_index = 0
    assert bpy.ops.r2sego.show_proxy() == {"FINISHED"}
    return bpy.data.objects["Proxy, round 0"]


def selected(mesh):
    chosen = np.empty(len(mesh.polygons), bool)
    mesh.polygons.foreach_get("select", chosen)
    return np.flatnonzero(chosen).tolist()


def legend():
    return {line.name: round(line.area, 3) for line in group().legend}


def check_a_shown_proxy_that_was_redone_since_is_told():
    copy = copied_bundle()
    bpy.ops.r2sego.show_proxy()
    bpy.ops.r2sego.refresh_scene()
    assert not group().older
    file = copy / "rounds" / "1" / "proxy" / "proxy.npz"
    os.utime(file, (1, 1))
    bpy.ops.r2sego.refresh_scene()
    assert group().older
    bpy.ops.r2sego.show_proxy()
    assert not group().older


def check_what_is_shown_in_a_hidden_collection_is_told():
    open_bundle()
    show = bpy.types.R2SEGO_OT_show_proxy.perform
    assert show(SimpleNamespace(look_inside=False), bpy.context).endswith(" faces")
    bpy.context.view_layer.layer_collection.children["room"].exclude = True
    told = show(SimpleNamespace(look_inside=False), bpy.context)
    assert told.endswith(" faces. It is hidden: show its collection in the Outliner"), told


def check_a_round_is_called_by_its_number_beside_another_bundle():
    """Blender adds .001 to the names of the second bundle's objects: "round 1.001" is no round."""
    open_bundle()
    bpy.ops.r2sego.show_proxy()
    bpy.ops.r2sego.show_candidates()
    open_here(bundle_of_one_name())
    told = [
        bpy.types.R2SEGO_OT_show_proxy.perform(SimpleNamespace(look_inside=False), bpy.context),
        bpy.types.R2SEGO_OT_show_candidates.perform(
            SimpleNamespace(colour_by="S", shown="ALL", frustum_size=0.1), bpy.context
        ),
    ]
    assert "Proxy, round 1.001" in bpy.data.objects
    assert [line.partition(":")[0] for line in told] == ["Proxy, round 1", "Candidates, round 1"]


def check_show_proxy():
    assert len(shown().data.polygons) == 13
    state().round_index = 9
    assert "round 9" in refused(bpy.ops.r2sego.show_proxy)


def check_the_proxy_is_coloured_by_what_is_chosen():
    mesh = shown().data
    area = np.empty(13, np.float32)
    mesh.polygons.foreach_get("area", area)
    for by, colours in (
        ("PROVENANCE", 5),
        ("SUPPORT", 6),
        ("CONFIDENCE", 5),
        ("VIEWS", 5),
        ("COVERAGE", 4),
        ("SUPPORT_GAP", 4),
    ):
        group().colour_by = by
        assert len(mesh.materials) == len(group().legend) == colours, by
        assert abs(sum(legend().values()) - area.sum()) < 0.02, by
    slot = np.empty(13, np.int32)
    mesh.polygons.foreach_get("material_index", slot)
    # Faces 0 and 1 are seen by no candidate; the support of the others is their number.
    assert slot.tolist() == [3, 3] + [2] * 11
    first = mesh.materials[2]
    assert first.name == "R2S-EGO support gap: robot sees, 2 or more", first.name
    assert abs(legend()["Robot does not see"] - area[:2].sum()) < 0.01


def check_a_legend_is_of_the_shown_proxy():
    shown()
    told = legend()
    assert told
    open_here(bundle_of_one_name())
    assert not group().legend and not group().legend_note
    open_here(BUNDLE)
    assert legend() == told
    bpy.data.objects.remove(bpy.data.objects["Proxy, round 0"])
    bpy.ops.r2sego.refresh_scene()
    assert not group().legend


def check_colours_that_need_a_coverage_say_so():
    open_bundle()
    bpy.ops.r2sego.show_proxy()  # of round 1, which has none
    group().colour_by = "COVERAGE"
    assert group().legend_note == "Measure Coverage first" and not len(group().legend)
    conduct("succeed")
    assert bpy.ops.r2sego.measure_coverage() == {"FINISHED"}
    assert calls() == [["coverage", str(BUNDLE), "--round", "1", "--json-progress"]]


def check_switching_colours_of_a_large_proxy_is_quick():
    shown()
    side = 320
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + side + 2], 1), np.stack([first, first + side + 2, first + side + 1], 1)]
    )
    mesh = bpy.data.meshes.new("large")
    mesh.from_pydata(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).tolist(), [], faces.tolist())
    for name in ("provenance", "support", "seen"):
        mesh.attributes.new(name, "INT", "FACE")
    mesh.attributes.new("confidence", "FLOAT", "FACE")
    mesh["r2sego_round"], mesh["r2sego_views"] = 0, 100
    bpy.data.objects["Proxy, round 0"].data = mesh
    assert len(mesh.polygons) > 200_000
    started_s = time.process_time()
    for by in ("SUPPORT", "COVERAGE", "PROVENANCE"):
        group().colour_by = by
    assert (time.process_time() - started_s) / 3 < 5.0
    assert legend()["Observed by captures"] == side**2


def check_faces_are_selected_in_a_box_and_a_lasso_and_cut():
    mesh = shown().data
    box = bpy.data.objects.new("box", None)
    box.empty_display_size = 0.5
    box.matrix_world = Matrix.Translation((0.0, 0.6, 0.6))
    bpy.context.scene.collection.objects.link(box)
    assert bpy.ops.r2sego.select_proxy_box(box="box") == {"FINISHED"}
    assert selected(mesh) == [12]  # the raised triangle
    view = Matrix.Translation((0.0, 0.0, -2.0))  # from 2 m above the origin, straight down
    window = Matrix(((1.0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0, -1.0, -0.2), (0, 0, -1.0, 0)))
    path = [{"name": "", "loc": loc, "time": 0.0} for loc in ((0, 0), (200, 0), (200, 200), (0, 200))]
    given = {
        "path": path,
        "region_size": (200, 200),
        "facing": False,
        "view_matrix": [v for row in view for v in row],
        "window_matrix": [v for row in window for v in row],
    }
    assert bpy.ops.r2sego.select_proxy_lasso(**given) == {"FINISHED"}
    assert 12 in selected(mesh) and len(selected(mesh)) > 2
    assert bpy.ops.r2sego.select_proxy_lasso(**{**given, "farthest": 1.7}) == {"FINISHED"}
    assert selected(mesh) == [12]
    below_m = [0.0, 0.0, -1.0, 0.1, *[0.0] * 20]  # a Clipping Region that shows what is lower
    assert bpy.ops.r2sego.select_proxy_lasso(**given, clip_planes=below_m) == {"FINISHED"}
    assert 12 not in selected(mesh) and len(selected(mesh)) > 1
    assert bpy.ops.r2sego.select_proxy_lasso(**{**given, "farthest": 1.7}) == {"FINISHED"}
    conduct("succeed")
    assert bpy.ops.r2sego.cut_proxy(name="window") == {"FINISHED"}
    (call,) = calls()
    assert call[:3] == ["edit-proxy", str(BUNDLE), "--cut"] and call[4:] == ["--name", "window", "--json-progress"]
    with np.load(call[3]) as cut:
        assert cut["round"] == 0
        with np.load(BUNDLE / "rounds/0/proxy/proxy.npz") as proxy:
            np.testing.assert_array_equal(cut["corners"], proxy["vertices"][proxy["faces"][[12]]])
    bpy.context.view_layer.objects.active = bpy.data.objects["Proxy, round 0"]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    conduct("succeed")
    assert bpy.ops.r2sego.cut_proxy() == {"FINISHED"}  # in Edit Mode too
    with np.load(calls()[0][3]) as cut:
        assert len(cut["corners"]) == 13
    assert bpy.ops.r2sego.select_proxy_box(box="box") == {"FINISHED"}  # leaves Edit Mode
    assert selected(mesh) == [12]
    mesh.polygons.foreach_set("select", np.zeros(13, bool))
    assert "no face of the proxy is selected" in refused(bpy.ops.r2sego.cut_proxy)


def check_faces_of_a_moved_proxy_are_selected_where_they_stand():
    proxy = shown()
    empty = bpy.data.objects.new("box", None)
    empty.empty_display_size = 0.5
    empty.matrix_world = Matrix.Translation((0.0, 0.6, 0.6))
    bpy.context.scene.collection.objects.link(empty)
    proxy.location.x = 5.0
    bpy.ops.r2sego.select_proxy_box(box="box")
    assert selected(proxy.data) == []
    empty.location.x = 5.0
    bpy.ops.r2sego.select_proxy_box(box="box")
    assert selected(proxy.data) == [12]
    conduct("succeed")
    bpy.ops.r2sego.cut_proxy(name="window")
    with np.load(calls()[0][3]) as cut, np.load(BUNDLE / "rounds/0/proxy/proxy.npz") as own:
        np.testing.assert_array_equal(cut["corners"], own["vertices"][own["faces"][[12]]])  # as the file has it
    view, window = (
        Matrix.Translation((-5.0, 0.0, -2.0)),
        Matrix(((1.0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0, -1.0, -0.2), (0, 0, -1.0, 0))),
    )
    path = [{"name": "", "loc": loc, "time": 0.0} for loc in ((0, 0), (200, 0), (200, 200), (0, 200))]
    for mirror in (1.0, -1.0):
        proxy.scale.x = mirror
        bpy.ops.r2sego.select_proxy_lasso(
            path=path,
            region_size=(200, 200),
            farthest=1.7,
            view_matrix=[v for row in view for v in row],
            window_matrix=[v for row in window for v in row],
        )
        assert selected(proxy.data) == [12], mirror


def check_a_drawn_surface_goes_to_the_engine_as_it_lies_in_the_world():
    shown()
    mesh = bpy.data.meshes.new("shelf")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    shelf = bpy.data.objects.new("shelf", mesh)
    bpy.context.scene.collection.objects.link(shelf)
    shelf.matrix_world = Matrix.Translation((0, 0, 1)) @ Matrix.Diagonal((-2, 1, 1, 1))  # mirrored
    bpy.context.view_layer.update()
    conduct("succeed")
    assert bpy.ops.r2sego.draw_proxy_surface(object_name="shelf") == {"FINISHED"}
    (call,) = calls()
    assert call[2] == "--draw" and call[4:6] == ["--name", "shelf"]
    with np.load(call[3]) as drawn:
        a, b, c = (drawn["vertices"][drawn["faces"][:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    assert abs(np.linalg.norm(cross, axis=1).sum() / 2 - 2.0) < 1e-5 and (cross[:, 2] > 0).all(), cross
    assert "No mesh object" in refused(bpy.ops.r2sego.draw_proxy_surface, object_name="nothing")
    (proxy,) = (one.name for one in bpy.data.objects if one.name.startswith("Proxy"))
    assert "the shown proxy itself" in refused(bpy.ops.r2sego.draw_proxy_surface, object_name=proxy)
    shelf.name = "\u68da"
    conduct("succeed")
    assert bpy.ops.r2sego.draw_proxy_surface(object_name=shelf.name) == {"FINISHED"}
    (call,) = calls()
    assert call[3].endswith(".npz") and call[4:6] == ["--name", "\u68da"], call


def check_edits_are_listed_and_taken_back():
    open_bundle()
    (edit,) = group().edits
    assert (edit.name, edit.kind, edit.faces) == ("hole", "cut away", 1) and edit.area > 0.1
    conduct("succeed")
    assert bpy.ops.r2sego.remove_proxy_edit() == {"FINISHED"}
    assert calls() == [["edit-proxy", str(BUNDLE), "--remove", "hole", "--json-progress"]]


def check_what_refine_redoes_is_asked():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.plan_refine() == {"FINISHED"}
    (call,) = calls()
    assert call[:5] == ["plan", str(BUNDLE), "--json-progress", "--preset", "preview"], call


def check_a_damaged_edit_is_a_problem_and_no_crash():
    copy = copied_bundle()
    (copy / "geometry/edits/hole.npz").write_bytes(b"PK")
    bpy.ops.r2sego.refresh_scene()
    assert "hole.npz" in state().problem
    assert OUT.parent in copy.parents
