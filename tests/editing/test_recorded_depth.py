"""Depth maps of any origin taken into a bundle: in any unit and file, refused in a sentence where they are damaged."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from bundles import new_bundle
from click.testing import CliRunner

from r2sego_blender.bundle import layout
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import R2SEgoError
from r2sego_blender.core.images import save_image
from r2sego_blender.editing.recorded_depth import record_depth, remove_depth
from r2sego_blender.geometry.estimators.estimated_depth import ESTIMATES

TRUE = np.linspace(1.0, 4.0, 80 * 60, dtype=np.float32).reshape(60, 80)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    captures = []
    for index in range(3):
        path = tmp_path / f"p{index}.png"
        save_image(path, np.full((60, 80, 3), 0.5, np.float32))
        camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, look_at((index - 1.0, -2, 1.4), (0, 0.5, 0.4)))
        captures.append(Capture(path.name, path, camera))
    nothing = SparsePoints.none(len(captures))

    def fill(folder: Path) -> None:
        (folder / "captures").mkdir()
        save_captures(folder / "captures", captures, nothing)

    return new_bundle(tmp_path / "a.r2s", fill=fill)


def _recorded(scene: Scene) -> list[np.ndarray | None]:
    captures, maps = scene.read(CAPTURES), scene.read(ESTIMATES)
    found = [maps.found(captures, index) for index in range(len(captures))]
    return [None if one is None else one.depth for one in found]


def _folder(tmp_path: Path, **maps: np.ndarray) -> Path:
    folder = tmp_path / "maps"
    folder.mkdir(exist_ok=True)
    for name, values in maps.items():
        np.save(folder / f"{name}.npy", values)
    return folder


def test_maps_of_every_file_stand_in_the_bundle_in_their_own_unit(scene, tmp_path):
    folder = _folder(tmp_path, p0=250.0 * TRUE)
    np.savez(folder / "p1.npz", depth=TRUE.astype(np.float16))
    (folder / "p2.png").write_bytes(cv2.imencode(".png", np.rint(60.0 * TRUE).astype(np.uint8))[1].tobytes())
    before = content_digest(scene.path / "captures")
    found = _recorded(record_depth(scene, folder))
    np.testing.assert_allclose(found[0], 250.0 * TRUE, rtol=1e-6)
    np.testing.assert_allclose(found[1], TRUE, rtol=1e-3)
    np.testing.assert_allclose(found[2], np.rint(60.0 * TRUE))
    assert content_digest(scene.path / "captures") == before
    for file in folder.iterdir():
        file.unlink()
    assert _recorded(Scene.open(scene.path))[0] is not None  # the bundle has its own


def test_inverse_depth_becomes_depth_and_what_is_nothing_of_it_is_unknown(scene, tmp_path):
    inverse = 3.0 / TRUE
    inverse[:5], inverse[5], inverse[6] = 0.0, np.nan, -1.0
    found = _recorded(record_depth(scene, _folder(tmp_path, p1=inverse), inverse=True))
    assert found[0] is None and found[2] is None
    np.testing.assert_allclose(found[1][7:], TRUE[7:] / 3.0, rtol=1e-5)
    assert not found[1][:7].any()


def test_larger_maps_are_kept_at_the_working_size(scene, tmp_path):
    large = cv2.resize(TRUE, (800, 600), interpolation=cv2.INTER_NEAREST)
    np.testing.assert_array_equal(_recorded(record_depth(scene, _folder(tmp_path, p0=large)))[0], TRUE)


@pytest.mark.parametrize(
    "values",
    [
        np.full((60, 80), np.nan, np.float32),
        np.full((60, 80), np.inf, np.float32),
        np.zeros((60, 80), np.float32),
        TRUE.T,
        TRUE[:, :50],
        np.ones((60, 80), complex),
        np.ones(7, np.float32),
        np.zeros((0, 0), np.float32),
        np.array(["a"]),
    ],
    ids=["nan", "infinite", "nothing", "turned", "cropped", "complex", "a row", "empty", "text"],
)
def test_maps_that_are_none_are_refused_in_a_sentence_and_change_nothing(scene, tmp_path, values):
    before = content_digest(scene.path)
    with pytest.raises(R2SEgoError) as refused:
        record_depth(scene, _folder(tmp_path, p0=TRUE, p1=values))
    assert refused.value.where and refused.value.cure and str(refused.value).isprintable()
    assert content_digest(scene.path) == before


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"no array", b"PK\x03\x04" + bytes(40)])
@pytest.mark.parametrize("suffix", [".npy", ".npz", ".exr", ".png"])
def test_damaged_files_are_refused(scene, tmp_path, content, suffix):
    folder = _folder(tmp_path)
    (folder / f"p0{suffix}").write_bytes(content)
    with pytest.raises(R2SEgoError):
        record_depth(scene, folder)


def test_a_map_that_says_it_is_huge_takes_no_memory(scene, tmp_path):
    folder = _folder(tmp_path)
    header = b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    (folder / "p0.npy").write_bytes(header.ljust(127) + b"\n" + bytes(64))
    with pytest.raises(R2SEgoError):
        record_depth(scene, folder)
    with (folder / "p0.npy").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(R2SEgoError):
        record_depth(scene, folder)


def test_a_folder_without_any_of_the_photographs_is_refused(scene, tmp_path):
    for folder in (_folder(tmp_path, other=TRUE), tmp_path / "none"):
        with pytest.raises(R2SEgoError):
            record_depth(scene, folder)


def test_the_command_says_what_there_is_and_takes_it_away(scene, tmp_path):
    folder = str(_folder(tmp_path, p0=TRUE, p2=TRUE))
    declared = (scene.path / "scene.toml").read_bytes()

    def run(*options: str):
        return CliRunner().invoke(main, ["estimate-depth", str(scene.path), *options])

    assert json.loads(run("--recorded", folder, "--json").stdout) == {
        "recorded": 2,
        "captures": 3,
        "by": "recorded depth maps",
        "of": ["p0.png", "p2.png"],
    }
    assert Scene.open(scene.path).declaration.backends["depth_estimator"] == "recorded depth maps"
    for wrong in (["--inverse"], ["--recorded", folder, "--remove"]):
        assert run(*wrong).exit_code == 1
    assert run("--remove").exit_code == 0
    assert (scene.path / "scene.toml").read_bytes() == declared
    assert not (scene.path / layout.ESTIMATES).exists()
    with pytest.raises(R2SEgoError):
        remove_depth(Scene.open(scene.path))
