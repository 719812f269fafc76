"""The commands for the proxy: edits, coverage and what the next refine redoes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bundles import IDENTITY, new_bundle
from click.testing import CliRunner

from r2sego_blender.bundle.runner import Plan, Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.core.arrays import save_arrays
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import GeometryError, SceneError
from r2sego_blender.core.images import save_image
from r2sego_blender.editing.proxy_edits import describe_edits, edit_proxy, move_proxy_edits
from r2sego_blender.geometry.proxy.edits import load_proxy_edits
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.geometry.visibility.coverage import Coverage
from r2sego_blender.pipeline import refine
from r2sego_blender.results.coverage_report import measure_coverage
from r2sego_blender.results.plan import describe_plan, plan_refinement
from r2sego_blender.views.selection import save_candidates

LENS = Camera(64, 48, 80.0, 80.0, 32.0, 24.0, np.eye(4))


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def grid() -> GeometryProxy:
    """A wall of 2 x 2 m at z = 2 in 8 x 8 cells, its free side towards the origin."""
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    vertices = np.stack([x.ravel(), y.ravel(), np.full(81, 2.0)], 1).astype(np.float32)
    first = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.stack([first, first + 10, first + 1], 1), np.stack([first, first + 9, first + 10], 1)])
    support = (np.arange(128) % 3).astype(np.uint16)
    zeros = np.zeros(128, np.uint8)
    return GeometryProxy(vertices, faces.astype(np.int32), zeros, support, np.ones(128, np.float32))


@pytest.fixture
def scene(tmp_path) -> Scene:
    def fill(folder: Path) -> None:
        (folder / "rounds/0/proxy").mkdir(parents=True)
        grid().save(folder / "rounds/0/proxy/proxy.npz")
        (folder / "rounds/0/selection").mkdir()
        ahead, away = np.eye(4), look_at((0, 0, 0), (0, 1, 0))
        save_candidates(folder / "rounds/0/selection", [LENS.at(pose) for pose in (ahead, ahead, away)])
        (folder / "rounds/0/selection/selection.npz").write_bytes(b"")

    return new_bundle(tmp_path / "room.r2s", fill)


@pytest.fixture
def cut_file(tmp_path) -> Path:
    proxy = grid()
    save_arrays(tmp_path / "window.npz", corners=proxy.vertices[proxy.faces[:5]], round=np.int64(0))
    return tmp_path / "window.npz"


def test_edits_are_made_listed_and_taken_back(scene, cut_file, tmp_path):
    save_arrays(tmp_path / "shelf.npz", vertices=np.eye(3), faces=np.array([[0, 1, 2]]))
    assert "no edits" in run("edit-proxy", scene.path, "--list").output
    done = run("edit-proxy", scene.path, "--cut", cut_file)
    assert done.exit_code == 0 and "window" in done.output and "5 faces" in done.output, done.output
    run("edit-proxy", scene.path, "--draw", tmp_path / "shelf.npz", "--name", "top shelf")
    run("edit-proxy", scene.path, "--cut", cut_file)
    told = json.loads(run("edit-proxy", scene.path, "--json").output)["edits"]
    assert [(one["name"], one["kind"]) for one in told] == [
        ("window", "cut"),
        ("top_shelf", "draw"),
        ("window_2", "cut"),
    ]
    assert told[0]["area_m2"] == pytest.approx(5 * 0.25**2 / 2, abs=1e-4)
    for name in ("window", "top_shelf", "window_2"):
        assert run("edit-proxy", scene.path, "--remove", name).exit_code == 0
    assert not (scene.path / "geometry/edits").exists()


def test_a_mesh_file_is_drawn_as_it_lies_in_the_world(scene, tmp_path):
    (tmp_path / "wall.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    (edit,) = edit_proxy(scene, draw=tmp_path / "wall.obj")
    assert edit.name == "wall" and edit.change.area_m2 == pytest.approx(0.5)
    assert edit.change.vertices.max(0).tolist() == [1, 0, 1]


@pytest.mark.parametrize("kind", ["glb", "gltf"])
def test_a_drawn_gltf_is_y_up(scene, tmp_path, kind):
    """As Blender and this project's own exports write it."""
    up = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 3, 0], [0, 0, -2]], [[0, 1, 2], [0, 1, 3]], process=False)
    up.export(tmp_path / f"wall.{kind}")
    (edit,) = edit_proxy(scene, draw=tmp_path / f"wall.{kind}")
    assert edit.change.vertices.min(0).tolist() == [0, 0, 0] and edit.change.vertices.max(0).tolist() == [1, 2, 3]


def test_a_proxy_of_an_earlier_world_frame_is_not_cut(scene, cut_file):
    Runner(scene).step("rounds/0/proxy", lambda folder: grid().save(folder / "proxy.npz"))
    larger = tuple(map(tuple, np.diag([1.1, 1.1, 1.1, 1.0]).tolist()))
    with pytest.raises(SceneError, match="was corrected since it was made, so it cannot be cut"):
        edit_proxy(scene.declare(world_from_capture=larger), cut=cut_file)
    assert len(edit_proxy(scene.declare(world_from_capture=IDENTITY), cut=cut_file)) == 1


def test_what_is_no_edit_is_refused_and_changes_nothing(scene, cut_file, tmp_path):
    edit_proxy(scene, cut=cut_file)
    before = content_digest(scene.path / "geometry")
    save_arrays(tmp_path / "other.npz", corners=np.ones((1, 3, 3)), round=np.int64(0))
    save_arrays(tmp_path / "late.npz", corners=grid().vertices[grid().faces[:1]], round=np.int64(3))
    (tmp_path / "broken.npz").write_bytes(b"PK")
    for given, message in (
        ({"cut": tmp_path / "other.npz"}, "not the proxy's"),
        ({"cut": tmp_path / "late.npz"}, "round 3 has no proxy"),
        ({"cut": tmp_path / "broken.npz"}, "no cut"),
        ({"draw": tmp_path / "broken.npz"}, "no drawn surface"),
        ({"remove": ["door"]}, "no edit 'door'.*window"),
    ):
        with pytest.raises(GeometryError, match=message):
            edit_proxy(scene, **given)
    assert content_digest(scene.path / "geometry") == before


def test_edits_move_with_the_world(scene, cut_file):
    move_proxy_edits(scene, np.eye(4))  # none yet
    edit_proxy(scene, cut=cut_file)
    move_proxy_edits(scene, np.diag([2.0, 2.0, 2.0, 1.0]))
    (edit,) = load_proxy_edits(scene.path / "geometry/edits")
    assert edit.change.removed[0, 2] == pytest.approx(4.0)
    assert describe_edits(scene)["edits"][0]["area_m2"] == pytest.approx(4 * 5 * 0.25**2 / 2, abs=1e-3)


def test_coverage_is_published_once_and_told(scene):
    done = run("coverage", scene.path, "--round", "0")
    assert done.exit_code == 0 and "3 candidate views of 128 faces" in done.output, done.output
    coverage = Coverage.load(scene.path / "rounds/0/coverage/coverage.npz")
    visible = coverage.seen == 2
    assert set(coverage.seen.tolist()) == {0, 2} and 0.2 < visible.mean() < 1.0
    middles = grid().vertices[grid().faces].mean(1)
    sees = np.array([0.8, 0.6])
    assert visible[(np.abs(middles[:, :2]) < sees).all(1)].all()
    assert not visible[(np.abs(middles[:, :2]) > sees + 0.25).any(1)].any()
    figures = measure_coverage(scene)
    parts = figures["areas_m2"]
    assert parts["gap"] + parts["weak"] + parts["covered"] == pytest.approx(parts["seen"], abs=1e-3)
    assert [record["step"] for record in scene.journal()] == ["rounds/0/coverage"]  # the second was passed over
    assert "round 4 has no candidate views" in run("coverage", scene.path, "--round", "4").output


def test_a_plan_follows_what_depends_on_what(scene, tmp_path):
    (scene.path / "in").write_text("1")

    def steps(on: Runner, setting: int) -> None:
        on.step("a.txt", lambda file: file.write_text("a"), inputs=["in"], parameters=setting)
        on.step("b.txt", lambda file: file.write_text("b"), inputs=["a.txt"])
        on.step("c.txt", lambda file: file.write_text("c"), inputs=["elsewhere"])

    def planned(setting: int = 1) -> dict[str, str]:
        dry = Plan(scene)
        steps(dry, setting)
        return {step.target: step.why for step in dry.steps}

    assert set(planned().values()) == {"it is not there yet"}
    steps(Runner(scene), 1)
    before = content_digest(scene.path)
    assert set(planned().values()) == {""}
    assert planned(2) == {"a.txt": "what it reads or a setting has changed", "b.txt": "a.txt is redone", "c.txt": ""}
    assert content_digest(scene.path) == before
    (scene.path / "in").write_text("2")
    assert [bool(why) for why in planned().values()] == [True, True, False]


def test_the_plan_of_a_refined_room_is_one_line(demo):
    told = json.loads(run("plan", demo.path, "--json").output)
    assert told["line"] == "Refine has nothing to redo" and told["redone"] == []
    told = json.loads(run("plan", demo.path, "--json", "--set", "collision.tolerance_m=0.07").output)
    assert told["redone"][:2] == ["collision", "rollouts"] and "stereo" in told["kept"]
    assert told["line"].startswith("Refine redoes collision, rollouts, ") and "proxy" in told["line"]
    proxy = GeometryProxy.load(demo.path / "rounds/0/proxy/proxy.npz")
    save_arrays(demo.path.parent / "c.npz", corners=proxy.vertices[proxy.faces[:9]], round=np.int64(0))
    edit_proxy(demo, cut=demo.path.parent / "c.npz")
    told = describe_plan(plan_refinement(Scene.open(demo.path)))
    assert told["redone"][0] == "proxy" and "priors" in told["kept"]
    edit_proxy(demo, remove=["c"])
    assert describe_plan(plan_refinement(Scene.open(demo.path)))["redone"] == []


@pytest.fixture
def demo(tmp_path):
    """A refined room as its journal tells it: every step of Algorithm 1 with stand-ins for the files."""
    captures = []
    for index in range(3):
        path = tmp_path / f"p{index}.png"
        save_image(path, np.full((48, 64, 3), 0.5, np.float32))
        captures.append(Capture(path.name, path, LENS))

    def fill(folder: Path) -> None:
        (folder / "captures").mkdir()
        save_captures(folder / "captures", captures)

    made = new_bundle(tmp_path / "demo.r2s", fill, overrides={"rounds": 1})

    class StandIn(Plan):
        def do(self, step):
            def write(place: Path) -> None:
                (place / "file.txt" if not place.suffix else place).write_text(step.target)
                if step.target == "rounds/0/proxy":
                    grid().save(place / "proxy.npz")

            Runner.do(self, replace(step, compute=write, read=None))

    refine(made, runner=StandIn(made))
    return made


def test_a_name_without_an_edit_is_refused(scene):
    result = run("edit-proxy", scene.path, "--name", "table")
    assert result.exit_code != 0 and "--name" in result.output
    assert describe_edits(scene) == {"edits": []}
