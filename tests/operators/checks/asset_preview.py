"""What holds of the splats drawn in a 3D view, checked inside Blender."""

import importlib
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Quaternion
from shown_asset import SPLATS, group, show
from support import MODULE


def check_what_the_preview_draws():
    preview = importlib.import_module(f"{MODULE}.panels.overlays.splat_preview")
    shown = show()
    bpy.ops.r2sego.mark_splats_box(lowest=(-0.6, -0.6, 0.4), highest=(0.6, 0.6, 2.0))
    splats = importlib.import_module(f"{MODULE}.r2sego_blender.bridge.asset.show_asset").drawn_splats(shown.data)
    order = preview.drawn_order(splats, backdrop=False)
    assert sorted(order) == sorted(np.flatnonzero(~splats.backdrop & (splats.opacities >= 0.05)))
    marks = splats.marked[order]
    assert marks[: marks.sum()].all() and 0 < marks.sum() < len(order)
    assert len(preview.drawn_order(splats, backdrop=True)) > len(order)
    colours = preview.colours_of(splats)
    assert (colours[splats.marked, 3] == 1.0).all() and (colours[splats.marked, 0] > 0.3).all()
    counts = [preview.drawn_count(200, 0.5, 0.25, moving) for moving in (False, True)]
    assert counts == [100, 25] and preview.drawn_count(3, 0.01, 0.01, True) == 1
    colour = np.where(splats.marked[:, None], 0.0, colours[:, :3])
    np.testing.assert_array_equal(colour, np.where(splats.marked[:, None], 0.0, splats.colours))
    assert preview.points_while_moving(50_000, "NVIDIA") == 50_000
    assert preview.points_while_moving(50_000, "SOFTWARE") < 20_000
    assert preview.points_while_moving(7, "SOFTWARE") == 7
    assert preview.scale_px([[1.0, 0.0], [0.0, 2.0]], 300) == 300.0


def check_gaussians_are_painted_from_far_to_near():
    order_of = importlib.import_module(f"{MODULE}.panels.overlays.gaussian_splats").farthest_first
    rng = np.random.default_rng(3)
    centres = rng.uniform(-3.0, 3.0, (5000, 3)).astype(np.float32)
    centres[:2000] = centres[2000:4000]  # equal ones keep their order
    view = np.array(Quaternion((0.9, 0.3, -0.2, 0.1)).normalized().to_matrix().to_4x4())
    view[:3, 3] = (0.1, 0.2, -1.0)
    perspective = np.array([[2.0, 0, 0.1, 0], [0, 3.0, 0, 0], [0, 0, -1.0, -0.02], [0, 0, -1.0, 0]])
    parallel = np.diag([0.2, 0.3, -0.002, 1.0])
    depths = -(centres @ view[2, :3] + view[2, 3])
    for window, seen in ((perspective, depths >= 0.2), (parallel, np.ones(5000, bool))):
        order = order_of(centres, window @ view)
        assert sorted(order) == list(np.flatnonzero(seen)) and len(order) > 100
        # Only what is nearer than a ten thousandth of what the view holds may stand the other way round.
        assert (np.diff(depths[order]) < 6e-4).all()
        place = np.empty(5000, int)
        place[order] = np.arange(len(order))
        assert (place[:2000] < place[2000:4000])[seen[:2000]].all()
    behind = order_of(centres - np.float32([0, 0, 50.0]), perspective @ np.diag([1.0, 1.0, -1.0, 1.0]))
    assert len(behind) == 0


def check_the_tiles_of_a_picture_hold_all_that_is_seen_and_no_empty_one():
    tiles_of = importlib.import_module(f"{MODULE}.panels.overlays.gaussian_splats").seen_tiles
    rng = np.random.default_rng(4)
    for width, height in ((64, 32), (70, 45), (31, 5), (1, 1)):
        alphas = np.zeros((height, width), np.float32)
        alphas[rng.random(alphas.shape) < 2.0 / alphas.size] = 1.0
        alphas[rng.random(alphas.shape) < 0.2] += 0.003  # too faint to be laid
        tiled = np.zeros(alphas.shape, int)
        for left, bottom, right, top in tiles_of(alphas, 8):
            assert alphas[bottom:top, left:right].max() >= 1.0 / 255.0
            tiled[bottom:top, left:right] += 1
        assert tiled.max(initial=0) <= 1 and (tiled[alphas >= 1.0 / 255.0] == 1).all()


def check_where_gaussians_are_painted_anew_while_the_view_moves():
    preview = importlib.import_module(f"{MODULE}.panels.overlays.splat_preview")
    assert preview.gaussians_while_moving(200_000, "NVIDIA")
    assert not preview.gaussians_while_moving(200_000, "SOFTWARE")
    assert not preview.gaussians_while_moving(3_000_000, "NVIDIA")


def check_what_the_preview_keeps_on_the_graphics_card_goes_with_its_object():
    preview = importlib.import_module(f"{MODULE}.panels.overlays.splat_preview")
    shown, view = show(), SimpleNamespace(scene=bpy.context.scene, space_data=None)
    group().preview = False
    preview._buffers[shown.data.session_uid, SPLATS, 0, False] = "the splats"
    preview.draw(view)
    assert len(preview._buffers) == 1  # switched off, it is soon on again
    for collection in shown.users_collection:  # as Delete in the 3D view
        collection.objects.unlink(shown)
    assert group().shown == shown
    preview.draw(view)
    assert not preview._buffers
