"""Every reader refuses a damaged file in a sentence, or gives clean values; and none has failed as it did once.

A minute of what ``python -m tools.fuzzing mutate`` does for an hour.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tools.fuzzing.child import RIGHT, Reader
from tools.fuzzing.children import Child
from tools.fuzzing.formats import HARNESSES

_SEED, _INPUTS = 20261126, 100
_KNOWN = Path(__file__).parents[2].parent / "shared/failing/hostile"
_READ_BY = {
    "cameras.json": ("poses/cameras.json", "poses/frozen.json"),
    "colmap-txt-images": ("poses/checked-images.txt", "poses/images.txt"),
    "depth.npz": ("depth/npz",),
    "depthc.npz": ("depth/packed.npz",),
    "depth.png": ("depth/png", "depth/confidence.png"),
    "frozen": ("poses/frozen.json",),
    "human.motion": ("motions/human.motion",),
    "human.npz": ("motions/human.npz",),
    "knees.toml": ("policies/layout.toml",),
    "mesh.obj": ("meshes/obj",),
    "mesh.stl": ("meshes/stl",),
    "motion.npz": ("motions/npz",),
    "polycam": ("poses/polycam.json",),
    "robot.xml": ("robots/wheeled.xml", "robots/legged.xml"),
    "scope.toml": ("declared/scope.toml",),
    "splat.glb": ("splats/glb",),
    "splat.gltf": ("splats/gltf",),
    "splat.ply": ("splats/ply", "splats/shown.ply"),
    "splat.splat": ("splats/splat",),
    "splat.usda": ("splats/usda",),
    "splat.usdc": ("splats/usdc",),
    "splat.usdz": ("splats/usdz",),
    "splat_ascii.ply": ("splats/ascii.ply",),
    "splat_compressed.ply": ("splats/compressed.ply",),
    "transforms.json": ("poses/transforms.json",),
    "bundle_captures_cameras.json": ("bundle/captures/cameras.json", "bundle/registered/cameras.json"),
    "bundle_captures_sparse.npz": ("bundle/captures/sparse.npz",),
    "bundle_geometry_completed_capture_00.png.npz": ("bundle/geometry/completed.npz",),
    "bundle_geometry_planes.npz": ("bundle/geometry/planes.npz",),
    "bundle_journal.jsonl": ("bundle/journal.jsonl",),
    "bundle_rounds_0_rollouts_rollouts.json": ("round/rollouts.json", "round/listed-rollouts.json"),
    "bundle_rounds_0_rollouts_rollouts.npz": ("round/rollouts.npz",),
    "bundle_rounds_0_selection_candidates.json": ("round/candidates.json",),
    "bundle_rounds_0_selection_candidates.npz": ("round/candidates.npz",),
    "bundle_rounds_0_selection_selection.json": ("round/selection.json",),
    "bundle_rounds_0_selection_selection.npz": ("round/selection.npz",),
    "bundle_rounds_0_views_000_pose.json": ("round/pose.json",),
    "bundle_scene.toml": ("declared/scene.toml",),
}
"""By the folder of inputs that failed once, the formats that read them."""

_NAMED = {harness.name: harness for harness in HARNESSES}


def _is_right(outcome):
    """Whether it was refused or is clean; beside other tests it may take some times longer than alone."""
    return outcome["class"] in RIGHT or (outcome["class"] == "slow" and outcome["s"] < 6.0)


@pytest.fixture(scope="module")
def child():
    with Child(_SEED) as process:
        yield process


@pytest.mark.parametrize("name", _NAMED)
def test_a_changed_file_is_refused_or_gives_clean_values(name, child):
    count = max(2, round(_INPUTS * _NAMED[name].share))
    assert [outcome for outcome, _ in child.outcomes(name, 0, count) if not _is_right(outcome)] == []


@pytest.mark.skipif(not _KNOWN.is_dir(), reason=f"there is no {_KNOWN}: inputs that failed once lie beside the project")
@pytest.mark.parametrize("folder", _READ_BY)
def test_what_failed_once_does_not_again(folder, tmp_path):
    found = []
    for name in _READ_BY[folder]:
        reader = Reader(tmp_path / name)
        with reader.changing(_NAMED[name]) as (place, _):
            for file in sorted((_KNOWN / folder).iterdir()):
                shutil.copyfile(file, place)
                found.append((file.name, reader.outcome(_NAMED[name])))
    assert found and [one for one in found if not _is_right(one[1])] == []


def test_every_folder_of_known_failures_has_its_reader():
    if not _KNOWN.is_dir():
        pytest.skip(f"there is no {_KNOWN}")
    assert {place.name for place in _KNOWN.iterdir() if place.is_dir()} <= set(_READ_BY)
