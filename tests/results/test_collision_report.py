"""r2sego check-collision on a bundle: its verdict is the exit status, its figures are the files'."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bundles import IDENTITY, new_bundle
from click.testing import CliRunner
from room_meshes import closed_room, observed_proxy

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.cli import main
from r2sego_blender.config.settings import CollisionSettings
from r2sego_blender.geometry.collision.collision import CollisionSurface, collision_surface
from r2sego_blender.geometry.collision.collision_check import SPHERE_RADIUS_M, CollisionCheck, check_collision
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.results.collision_report import CollisionReport, check_scene, lines
from r2sego_blender.robot.rollouts.standing import Standing


@pytest.fixture(scope="module")
def proxy() -> GeometryProxy:
    """A closed room of 4 by 3 m with a box on its floor."""
    mesh = closed_room((4, 3, 2.4), ((0.8, 0.5, 0.0), (1.6, 1.1, 0.5))).subdivide_to_size(0.1)
    return observed_proxy(mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def surface(proxy) -> CollisionSurface:
    return collision_surface(proxy, CollisionSettings())


@pytest.fixture
def scene(proxy, surface, tmp_path) -> Scene:
    """As much of a refined scene as the check reads."""

    def fill(folder: Path) -> None:
        (folder / "rounds/0/proxy").mkdir(parents=True)
        (folder / "rounds/0/asset.ply").write_text("ply\n")
        proxy.save(folder / "rounds/0/proxy/proxy.npz")
        write_collision(surface, folder / "collision")

    return new_bundle(tmp_path / "room.r2s", fill)


def checked(scene: Scene) -> tuple[int, dict]:
    done = CliRunner().invoke(main, ["check-collision", str(scene.path), "--json"])
    return done.exit_code, json.loads(done.stdout)


def test_a_sound_surface_passes(scene):
    status, facts = checked(scene)
    assert status == 0 and facts["passed"]
    assert facts["spheres"] == facts["at_rest"] == facts["rest_within_1_cm"] > 200
    assert facts["rest_within_1_cm_of_proxy"] == facts["spheres"]
    assert facts["fell_through"] == facts["left_the_floor"] == 0
    assert facts["vertex_error_m"] < 1e-5 and facts["largest_gap_m"] < 0.01
    assert facts["robot_stands"] and np.linalg.norm(facts["robot_place_m"]) < 0.1


def test_a_surface_that_lost_its_pieces_fails(scene):
    for hull in (scene.collision_folder / "hulls").glob("*.obj"):
        hull.unlink()
    text = (scene.collision_folder / "scene.xml").read_text().splitlines()
    kept = [line for line in text if "piece_" not in line]
    (scene.collision_folder / "scene.xml").write_text("\n".join(kept))
    status, facts = checked(scene)
    assert status == 1 and not facts["passed"]
    assert facts["fell_through"] > 5 and facts["pieces"] == 0


def test_its_lines_say_what_was_found(scene):
    done = CliRunner().invoke(main, ["check-collision", str(scene.path)])
    assert done.exit_code == 0
    assert "0 fell through" in done.stdout and "the robot stands at" in done.stdout


def with_a_plate(scene: Scene, height_m: float) -> tuple[float, float]:
    """Put one more piece on the free floor, where a sphere comes to rest; returns where."""
    ends = check_collision(scene.collision_folder).ends
    x, y, _ = ends[np.linalg.norm(ends - (-1.0, -0.5, SPHERE_RADIUS_M), axis=1).argmin()]
    plate = trimesh.creation.box((0.06, 0.06, height_m))
    plate.apply_translation((x, y, height_m / 2))
    plate.export(scene.collision_folder / "hulls" / "plate.obj")
    file = scene.collision_folder / "scene.xml"
    text = file.read_text().replace("</asset>", '<mesh name="plate" file="hulls/plate.obj"/></asset>')
    file.write_text(text.replace("</worldbody>", '<geom name="plate" type="mesh" mesh="plate"/></worldbody>'))
    return x, y


def test_a_lone_sphere_that_floats_is_told_with_its_place_and_passes_up_to_3_cm(scene):
    x, y = with_a_plate(scene, 0.02)
    status, facts = checked(scene)
    (off,) = facts["off_surface"]
    assert status == 0 and facts["passed"] and facts["rest_within_1_cm"] == facts["spheres"] - 1
    assert off["what"] == "floats" and off["gap_m"] == pytest.approx(0.02, abs=1e-3)
    np.testing.assert_allclose(off["place_m"], (x, y, 0.02 + SPHERE_RADIUS_M), atol=0.01)
    told = CliRunner().invoke(main, ["check-collision", str(scene.path)]).stdout
    assert f"({x:.2f}, {y:.2f}, 0.07) floats by 2.0 cm" in told
    assert f"passed, with 1 of {facts['spheres']} spheres off the surface" in told


def test_spheres_that_rest_at_one_place_are_told_once_with_how_many():
    """Two floating within a millimetre, one beside them, one sunk in at the same place, one fallen."""
    ends = np.array([(1.0, 2.0, 0.07), (1.0, 2.0, 0.03), (1.0, 2.001, 0.07), (1.0, 2.1, 0.07), (0.0, 0.0, 9.0)])
    found = CollisionCheck(
        pieces=1,
        vertex_error_m=0.0,
        starts=ends + np.array([0, 0, 1]),
        ends=ends,
        at_rest=np.array([True, True, True, True, False]),
        fell_through=np.arange(5) == 4,
        left=np.zeros(5, bool),
        gap_m=np.array([0.021, -0.02, 0.0205, 0.015, 9.0]),
        proxy_gap_m=np.full(5, np.nan),
        simulated_s=1.0,
    )
    report = CollisionReport(found, Standing((0.0, 0.0), 0.0, 2.0, 0.0, "", ""))
    assert [line for line in lines(report) if " at (" in line and line.startswith("  ")] == [
        "  one dropped at (0.00, 0.00, 10.00) fell through",
        "  2 at (1.00, 2.00, 0.07) float by 2.1 cm",
        "  one at (1.00, 2.00, 0.03) is sunk in by 2.0 cm",
        "  one at (1.00, 2.10, 0.07) floats by 1.5 cm",
    ]
    assert [one["spheres"] for one in report.to_json()["off_surface"]] == [1, 2, 1, 1]
    assert "5 of 5 spheres off the surface" in lines(report)[-1]


def test_a_sphere_that_floats_higher_is_not_passed(scene):
    with_a_plate(scene, 0.04)
    told = CliRunner().invoke(main, ["check-collision", str(scene.path)])
    assert told.exit_code == 1
    assert "not passed: one rests 4.0 cm off, 3 cm are allowed" in told.stdout


def test_a_surface_that_was_changed_since_is_not_checked(scene, surface):
    Runner(scene).step("collision", lambda folder: write_collision(surface, folder))
    assert check_scene(scene).passed
    mesh = scene.collision_folder / "mesh.obj"
    mesh.write_bytes(mesh.read_bytes()[:-200])
    done = CliRunner().invoke(main, ["check-collision", str(scene.path)])
    assert done.exit_code == 1 and "collision: it is not as it was made" in done.stderr


def test_a_surface_of_an_earlier_world_frame_is_not_checked(scene, surface):
    Runner(scene).step("collision", lambda folder: write_collision(surface, folder))
    moved = tuple((*row[:3], row[3] + (index == 2)) for index, row in enumerate(IDENTITY))
    scene.declare(world_from_capture=moved)
    done = CliRunner().invoke(main, ["check-collision", str(scene.path)])
    assert done.exit_code == 1 and "corrected since" in done.stderr


def test_a_scene_that_was_not_refined_is_refused(tmp_path):
    new_bundle(tmp_path / "room.r2s")
    done = CliRunner().invoke(main, ["check-collision", str(tmp_path / "room.r2s")])
    assert done.exit_code == 1 and "no collision surface yet" in done.stderr
