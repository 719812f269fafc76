"""The benchmark of registration scores each registrar on the same frames, and lets no wrong one through."""

import pytest
from painted_room import write_painted_room

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from tools.benchmarks.registration import bench_registration, lines

TINY = {"stereo.max_side_px": 160, "proxy.voxel_m": 0.05, "proxy.truncation_m": 0.12}
LOOSE = {"registration.min_inliers": 10, "registration.max_sigma_m": 0.1, "registration.max_sigma_deg": 4.0}


@pytest.mark.slow
def test_both_registrars_are_scored_on_the_same_frames(tmp_path):
    folder, bundle = tmp_path / "scene", tmp_path / "scene.r2s"
    folder.mkdir()
    scene = write_painted_room(folder)
    create_scene(bundle, scene, scene / "cameras.json")
    refine(Scene.open(bundle).declare(overrides=TINY | LOOSE), until=PROXY.of_round(0).name)
    figures = bench_registration(scene, bundle)
    for name in ("pnp", "vggt"):
        assert {kind: one["frames"] for kind, one in figures[name].items()} == {
            "photographs": 2,
            "generated": 2,
            "drifted": 2,
            "wrong": 10,
        }
        assert figures[name]["wrong"]["accepted"] == 0
        for kind in ("photographs", "generated", "drifted"):
            one = figures[name][kind]
            assert one["accepted"] == 2 and one["cm"] < 4.0 and one["degrees"] < 1.5, (name, kind)
    assert "2/2" in "\n".join(lines(figures))
