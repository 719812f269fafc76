"""Edits of the proxy: a cut takes exactly its faces, a drawn surface adds exactly its own."""

import dataclasses

import numpy as np
import pytest
import trimesh

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.edited_proxy import cut_of, drawn_surface, edited
from r2sego_blender.geometry.proxy.edits import Edit, load_proxy_edits, new_name
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource

PER_FACE = ("provenance", "support", "confidence", "instance")


def proxy_of(mesh, size_m: float) -> GeometryProxy:
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, size_m)
    count = len(faces)
    rng = np.random.default_rng(count)
    return GeometryProxy(
        vertices.astype(np.float32),
        faces.astype(np.int32),
        rng.integers(0, 3, count).astype(np.uint8),
        rng.integers(0, 9, count).astype(np.uint16),
        rng.random(count, np.float32),
        rng.integers(0, 2, count).astype(np.int32),
        ("crate",),
    )


@pytest.fixture(scope="module")
def proxy(room):
    return proxy_of(room.mesh, 0.15)


@pytest.fixture(scope="module")
def completed(room):
    return [
        CompletedDepth(d.depth, np.full(d.depth.shape, DepthSource.OBSERVED, np.uint8), d.camera)
        for d in room.depth_maps
    ]


def within(proxy, low, high) -> np.ndarray:
    middles = proxy.vertices[proxy.faces].mean(1)
    return ((middles > low) & (middles < high)).all(1)


def corners(proxy, chosen) -> np.ndarray:
    return proxy.vertices[proxy.faces[chosen]]


def test_a_cut_takes_the_chosen_faces_and_nothing_else_changes(proxy):
    rng = np.random.default_rng(0)
    regions = (
        within(proxy, (-1.0, -1.6, 0.5), (0.3, 1.6, 1.5)),
        rng.random(len(proxy.faces)) < 0.3,
        np.arange(len(proxy.faces)) == 7,
    )
    for chosen in regions:
        after = edited(proxy, [Edit("cut", 1, cut_of(proxy, corners(proxy, chosen)))], ())
        np.testing.assert_array_equal(after.faces, proxy.faces[~chosen])
        assert after.vertices.tobytes() == proxy.vertices.tobytes()
        for name in PER_FACE:
            assert getattr(after, name).tobytes() == getattr(proxy, name)[~chosen].tobytes(), name


def test_a_cut_takes_the_same_region_of_another_rounds_mesh(room, proxy):
    low, high = (-1.0, 1.4, 0.5), (0.3, 1.6, 1.5)  # of the far wall
    other = proxy_of(room.mesh, 0.06)
    cut = cut_of(proxy, corners(proxy, within(proxy, low, high)))
    after = edited(other, [Edit("cut", 1, cut)], ())
    gone = len(other.faces) - len(after.faces)
    surely = within(other, np.add(low, 0.15), np.subtract(high, (0.15, 0, 0.15)))
    possibly = within(other, np.subtract(low, 0.15), np.add(high, 0.15))
    assert surely.sum() <= gone <= possibly.sum()
    left = corners(after, slice(None)).mean(1)
    assert not ((left > np.add(low, 0.15)) & (left < np.subtract(high, (0.15, 0, 0.15)))).all(1).any()


def test_a_cut_of_one_side_of_a_board_leaves_the_other():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    board = trimesh.Trimesh(
        np.concatenate([vertices, np.add(vertices, (0, 0.01, 0))]),
        np.concatenate([faces, faces[:, ::-1] + 4]),
        process=False,
    )
    coarse, fine = proxy_of(board, 0.2), proxy_of(board, 0.1)
    front = coarse.vertices[coarse.faces][:, :, 1].max(1) < 0.005
    after = edited(fine, [Edit("cut", 1, cut_of(coarse, corners(coarse, front)))], ())
    assert len(after.faces) == len(fine.faces) // 2
    assert (after.vertices[after.faces][:, :, 1] > 0.005).all()


def test_faces_that_are_not_the_proxys_are_refused(proxy):
    wrong = corners(proxy, slice(0, 3)).copy()
    wrong[1] += 1e-4
    for given in (wrong, wrong[:0]):
        with pytest.raises(GeometryError, match="not the proxy's"):
            cut_of(proxy, given)


def test_taking_a_cut_back_brings_back_its_own_faces_alone(proxy):
    first, second = (within(proxy, (x, 1.4, 0.4), (x + 0.6, 1.6, 1.4)) for x in (-1.0, -0.4))
    one = Edit("one", 1, cut_of(proxy, corners(proxy, first)))
    between = edited(proxy, [one], ())
    two = Edit("two", 2, cut_of(between, corners(proxy, second & ~first), [one]))
    alone = edited(proxy, [two], ())
    np.testing.assert_array_equal(alone.faces, proxy.faces[~(second & ~first)])


def test_a_drawn_surface_is_a_prior_with_the_captures_evidence(proxy, completed, room):
    square = np.array([[-0.5, 1.2, 0.5], [0.5, 1.2, 0.5], [0.5, 1.2, 1.5], [-0.5, 1.2, 1.5]])
    drawn = drawn_surface(square, [[0, 1, 2], [0, 2, 3]])
    assert drawn.area_m2 == pytest.approx(1.0) and len(drawn.faces) > 100
    after = edited(proxy, [Edit("shelf", 1, drawn)], completed)
    old, new = slice(0, len(proxy.faces)), slice(len(proxy.faces), None)
    for name in ("faces", *PER_FACE):
        assert getattr(after, name)[old].tobytes() == getattr(proxy, name).tobytes(), name
    assert (after.provenance[new] == Provenance.PRIOR).all() and (after.instance[new] == 0).all()
    seen = np.median(after.support[new])  # it hangs free before the far wall that all captures look at
    assert 2 <= seen <= len(room.captures)
    assert (after.confidence[new] < 0.2).all()  # stereo lies on the wall behind it
    behind = drawn_surface(np.add(square, (0, 0.5, 0)), [[0, 1, 2], [0, 2, 3]])  # in the wall: nobody sees it
    assert (edited(proxy, [Edit("hidden", 1, behind)], completed).support[new] == 0).all()


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [], "no faces"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "no faces"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "without vertices"),
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1e9, 0, 0], [0, 1e9, 0]], [[0, 1, 2]], "faces of 0.1 m"),  # a trillion of them
    ],
)
def test_what_is_no_surface_is_refused(vertices, faces, message):
    with pytest.raises(GeometryError, match=message):
        drawn_surface(np.array(vertices, float), np.array(faces, int).reshape(-1, 3))


def test_edits_are_kept_in_their_order_and_move_with_the_world(proxy, tmp_path):
    chosen = within(proxy, (-1.0, 1.4, 0.5), (0.3, 1.6, 1.5))
    edits = [Edit("b", 1, cut_of(proxy, corners(proxy, chosen))), Edit("a", 2, drawn_surface(np.eye(3), [[0, 1, 2]]))]
    for edit in edits:
        edit.save(tmp_path)
    read = load_proxy_edits(tmp_path)
    assert [(edit.name, edit.order, edit.change.kind) for edit in read] == [("b", 1, "cut"), ("a", 2, "draw")]
    assert [edit.count for edit in read] == [chosen.sum(), len(edits[1].change.faces)]
    similarity = np.array([[0, -2, 0, 1], [2, 0, 0, 3], [0, 0, 2, -1], [0, 0, 0, 1.0]])
    moved_vertices = (proxy.vertices @ similarity[:3, :3].T + similarity[:3, 3]).astype(np.float32)
    moved = dataclasses.replace(proxy, vertices=moved_vertices)
    after = edited(moved, [read[0].transformed(similarity)], ())
    np.testing.assert_array_equal(after.faces, proxy.faces[~chosen])
    cut, before = read[0].transformed(similarity).change, read[0].change
    assert (cut.reach_m, cut.area_m2) == pytest.approx((2 * before.reach_m, 4 * before.area_m2))
    surface = read[1].transformed(similarity).change
    assert surface.area_m2 == pytest.approx(4 * read[1].change.area_m2)
    np.testing.assert_allclose(surface.vertices[0], similarity[:3, :3] @ (1, 0, 0) + similarity[:3, 3])


def test_a_damaged_edit_is_named(tmp_path):
    assert load_proxy_edits(tmp_path / "nowhere") == ()
    (tmp_path / "hole.npz").write_bytes(b"PK and no more")
    with pytest.raises(GeometryError, match=r"hole\.npz.*edit-proxy"):
        load_proxy_edits(tmp_path)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        ("draw", {"faces": np.array([[0, 1, 9]])}),
        ("draw", {"faces": np.array([[0, 1, -1]])}),
        ("draw", {"vertices": np.full((3, 3), np.inf)}),
        ("draw", {"vertices": np.zeros((3, 2))}),
        ("draw", {"area_m2": np.array("a lot")}),
        ("cut", {"removed": np.full((2, 6), np.nan)}),
        ("cut", {"kept": np.zeros((2, 5))}),
        ("cut", {"reach_m": np.array(np.inf)}),
        ("cut", {"reach_m": np.zeros(3)}),
    ],
)
def test_an_edit_of_a_stranger_has_finite_numbers_that_belong_together(tmp_path, kind, wrong):
    arrays = {
        "draw": {"vertices": np.eye(3), "faces": np.array([[0, 1, 2]])},
        "cut": {"removed": np.zeros((2, 6)), "kept": np.zeros((3, 6)), "reach_m": np.array(0.1)},
    }[kind]
    whole = {"kind": np.array(kind), "order": np.array(1), "area_m2": np.array(1.0), **arrays}
    np.savez(tmp_path / "hole.npz", **whole)
    assert len(load_proxy_edits(tmp_path)) == 1
    np.savez(tmp_path / "hole.npz", **whole | wrong)
    with pytest.raises(GeometryError, match=r"hole\.npz"):
        load_proxy_edits(tmp_path)


def test_names_of_edits_are_files_and_told_apart():
    assert new_name("Cut / window", []) == "Cut___window"
    assert new_name("cut", ["Cut", "cut_2"]) == "cut_3"
