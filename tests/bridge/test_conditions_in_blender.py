"""Cycles and EEVEE show the same conditions as the z-buffer, in pip bpy."""

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import fake_bundle
import numpy as np
import pytest
from scipy import ndimage

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")
pytest.importorskip("OpenEXR", reason="OpenEXR is not installed")

import OpenEXR  # noqa: E402

from r2sego_blender.bridge.generation import conditions as bridge  # noqa: E402
from r2sego_blender.bridge.generation.conditions import PASSES, ConditionScene, render_path  # noqa: E402
from r2sego_blender.core.cameras import Camera, look_at  # noqa: E402
from r2sego_blender.core.errors import GenerationError  # noqa: E402
from r2sego_blender.core.file_locks import try_lock  # noqa: E402
from r2sego_blender.generation.conditions.blender_conditions import read_condition  # noqa: E402
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer  # noqa: E402
from r2sego_blender.geometry.proxy.proxy import GeometryProxy  # noqa: E402
from r2sego_blender.geometry.visibility import rasterizer  # noqa: E402

pytestmark = pytest.mark.own_process  # without EGL, or with a driver that fails, Blender aborts


def bumpy_room() -> GeometryProxy:
    """A wavy floor and two round objects under no roof, with faces nobody saw and faces turned away."""
    side = 40
    x, y = np.meshgrid(np.linspace(-2, 2, side), np.linspace(-2, 2, side), indexing="ij")
    floor = np.stack([x, y, 0.15 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3)
    parts = [(floor, grid_faces(side, side))]
    turn, tilt = np.meshgrid(np.linspace(0, 2 * np.pi, 24), np.linspace(0.05, np.pi - 0.05, 12), indexing="ij")
    ball = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    for centre, radius in (((0.4, 0.3, 0.6), 0.35), ((-0.5, 0.6, 0.8), 0.25)):
        parts.append((ball.reshape(-1, 3) * radius + centre, grid_faces(24, 12)))
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    faces = np.concatenate([f + s for (_, f), s in zip(parts, starts[:-1], strict=True)])
    part = np.repeat(np.arange(3), [len(f) for _, f in parts])
    rng = np.random.default_rng(5)
    turned = rng.random(len(faces)) < 0.1
    faces[turned] = faces[turned][:, ::-1]
    return GeometryProxy(
        np.concatenate([v for v, _ in parts]).astype(np.float32),
        faces.astype(np.int32),
        rng.integers(0, 3, len(faces)).astype(np.uint8),
        rng.integers(0, 3, len(faces)).astype(np.uint16),
        np.ones(len(faces), np.float32),
        np.array([0, 1, 700], np.int32)[part],
    )


def grid_faces(rows: int, columns: int) -> np.ndarray:
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([a, a + columns, a + columns + 1, a + 1], axis=1)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


LENSES = {
    "centred": Camera(160, 120, 130.0, 130.0, 80.0, 60.0, np.eye(4)),
    "fx > fy, off centre": Camera(160, 120, 180.5, 118.25, 95.75, 41.5, np.eye(4)),
    "fy > fx, portrait, off centre": Camera(120, 160, 101.0, 134.5, 42.25, 97.5, np.eye(4)),
}
POSES = (look_at((1.6, -1.4, 1.5), (0.0, 0.2, 0.4)), look_at((-1.2, -1.1, 0.9), (0.1, 0.4, 0.5)))
PATH = [lens.at(pose) for lens in LENSES.values() for pose in POSES]


def agrees(found, expected, depth_share: float, normal_share: float, flag_share: float) -> None:
    """Shares of pixels: depth within 1 mm or 0.1 %, normals within 0.5 degrees, equal numbers."""
    assert found.camera is expected.camera
    seen = (found.depth > 0) & (expected.depth > 0)
    near = np.abs(found.depth - expected.depth) <= np.maximum(1e-3, 1e-3 * expected.depth)
    assert (near & ((found.depth > 0) == (expected.depth > 0))).mean() >= depth_share
    cosine = np.sum(found.normal[seen] * expected.normal[seen], axis=-1)
    assert (cosine >= np.cos(np.radians(0.5))).mean() >= normal_share
    for name in ("provenance", "validity", "instance"):
        assert getattr(found, name).dtype == getattr(expected, name).dtype
        assert (getattr(found, name) == getattr(expected, name)).mean() >= flag_share, name


def edges_within_one_pixel(found, expected) -> None:
    """Where another object is seen, one pixel further that object is expected."""
    for number in np.unique(expected.instance):
        shown, wanted = found.instance == number, expected.instance == number
        around = ndimage.binary_dilation(wanted, np.ones((3, 3)))
        assert not (shown & ~around).any()
        inside = ndimage.binary_erosion(wanted, np.ones((3, 3)), border_value=1)
        assert not (inside & ~shown).any()


def render_conditions(proxy, path, folder, engine="cycles"):
    shown = ConditionScene(proxy, engine)
    try:
        return render_path(shown, path, folder, engine)
    finally:
        shown.remove()


@pytest.fixture(scope="module")
def in_cycles(tmp_path_factory):
    bpy.ops.wm.read_homefile(use_empty=True)
    folder = tmp_path_factory.mktemp("cycles")
    return folder, render_conditions(bumpy_room(), PATH, folder)


@pytest.mark.parametrize("frame", range(len(PATH)))
def test_cycles_agrees_with_the_z_buffer(in_cycles, frame):
    found = read_condition(in_cycles[1][frame], PATH[frame])
    expected = ZBufferRenderer(bumpy_room()).condition(PATH[frame])
    agrees(found, expected, depth_share=0.995, normal_share=0.995, flag_share=0.995)
    edges_within_one_pixel(found, expected)
    assert {0.0, 1.0} == set(np.unique(found.validity))
    assert {0, 1, 700} == set(np.unique(found.instance))


def test_nothing_else_is_written_and_the_manifest_tells_all(in_cycles):
    folder, files = in_cycles
    names = [f"{index:03d}.exr" for index in range(len(PATH))]
    assert [file.name for file in files] == names
    assert sorted(file.name for file in folder.iterdir()) == [*names, "manifest.json"]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["complete"] and manifest["renderer"] == f"Cycles {bpy.app.version_string.split()[0]}"
    assert [frame["camera"] for frame in manifest["frames"]] == [camera.to_json() for camera in PATH]
    with OpenEXR.File(str(files[0]), separate_channels=True) as image:
        assert {name.split(".")[1] for name in image.channels()} >= set(PASSES) == set(manifest["passes"])
        assert {channel.pixels.dtype for channel in image.channels().values()} == {np.dtype(np.float32)}


def test_derived_passes_follow_from_depth_and_pose(in_cycles):
    found = read_condition(in_cycles[1][3], PATH[3])
    seen = found.depth > 0
    with OpenEXR.File(str(in_cycles[1][3]), separate_channels=True) as image:
        channels = {name.partition(".")[2]: channel.pixels for name, channel in image.channels().items()}
    np.testing.assert_allclose(channels["Distance.X"][seen], found.distance[seen], rtol=1e-5)
    turned = np.stack([channels[f"NormalCamera.{axis}"] for axis in "RGB"], axis=-1)
    np.testing.assert_allclose(turned[seen], found.normal_camera[seen], atol=1e-4)


def test_blender_is_left_as_it_was(scene, tmp_path):
    before = {name: len(getattr(bpy.data, name)) for name in ("scenes", "objects", "meshes", "cameras")}
    render_conditions(fake_bundle.proxy(), [fake_bundle.cameras()[0]], tmp_path)
    assert before == {name: len(getattr(bpy.data, name)) for name in before}
    assert not any("conditions" in material.name for material in bpy.data.materials)


def test_the_mesh_goes_to_cycles_once(scene, tmp_path, capfd):
    shown = ConditionScene(bumpy_room())
    for index, camera in enumerate(PATH):
        shown.render(camera, tmp_path / f"{index}.exr")
    shown.remove()
    lines = capfd.readouterr().out.splitlines()
    if not any("Sample 1/1" in line for line in lines):
        pytest.skip("this Blender does not print the steps of a render")
    assert sum("Sample 1/1" in line for line in lines) == len(PATH)
    assert sum(line.endswith("Updating Scene BVH | Building") for line in lines) == 1


def test_a_folder_may_have_braces_in_its_name(scene, tmp_path):
    folder = tmp_path / "{room} 1"
    (file,) = render_conditions(fake_bundle.proxy(), [fake_bundle.cameras()[0]], folder)
    assert file.parent == folder and file.is_file()


def test_a_folder_that_cannot_be_written_is_an_error(scene, tmp_path):
    (tmp_path / "000.exr").mkdir()
    with pytest.raises(GenerationError, match=r"000\.exr"):
        render_conditions(fake_bundle.proxy(), [fake_bundle.cameras()[0]], tmp_path)
    assert not (tmp_path / "manifest.json").exists()


def test_a_path_that_ends_half_way_leaves_whole_images_and_no_manifest(tmp_path):
    class BreakingOff(ConditionScene):
        def __init__(self):
            self.left = 2

        def render(self, camera, file):
            self.left -= 1
            if not self.left:
                raise GenerationError("Blender could not render: out of memory", where=file)
            file.write_bytes(b"exr")

    (tmp_path / bridge.MANIFEST).write_text("{}")  # of an earlier path
    with pytest.raises(GenerationError, match=r"001\.exr: .*out of memory"):
        bridge.render_path(BreakingOff(), [LENSES["centred"]] * 3, tmp_path, "cycles")
    assert [file.name for file in tmp_path.iterdir()] == ["000.exr"]


def test_machines_that_share_a_clip_make_together_what_one_makes_alone(in_cycles, tmp_path):
    shown = ConditionScene(bumpy_room(), "cycles")
    last = range(2, len(PATH))
    assert [file.name for file in bridge.render_path(shown, PATH, tmp_path, "cycles", only=last)] == [
        f"{index:03d}.exr" for index in last
    ]
    assert not (tmp_path / bridge.MANIFEST).exists()
    with pytest.raises(GenerationError, match=rf"no frame from {len(PATH)} to 99"):
        bridge.render_path(shown, PATH, tmp_path, "cycles", only=range(len(PATH), 100))
    bridge.render_path(shown, PATH, tmp_path, "cycles", only=range(2))
    shown.remove()
    whole = in_cycles[1][0].parent
    assert (tmp_path / bridge.MANIFEST).read_bytes() == (whole / bridge.MANIFEST).read_bytes()
    for index, camera in enumerate(PATH):
        parts, alone = (read_condition(folder / f"{index:03d}.exr", camera) for folder in (tmp_path, whole))
        np.testing.assert_array_equal(parts.depth, alone.depth)


def test_blenders_that_share_a_path_render_each_frame_once_and_what_a_dead_one_left(tmp_path):
    """Threads in place of Blenders: a lock is of the file that was opened, whichever process holds it."""
    rendered, meanwhile = [], threading.Barrier(4)

    class Counting(ConditionScene):
        def __init__(self):
            pass

        def render(self, camera, file):
            rendered.append(file.name)
            time.sleep(0.002)
            file.write_bytes(b"exr")

    path = [LENSES["centred"]] * 40
    (tmp_path / ".locks").mkdir()
    (tmp_path / ".locks" / "007").touch()  # of a Blender that died: nobody holds it
    held = (tmp_path / ".locks" / "003").open("ab")
    assert try_lock(held)

    def share():
        meanwhile.wait()
        return bridge.render_shared(Counting(), path, tmp_path, "cycles")

    with ThreadPoolExecutor(4) as pool:
        shares = [one.result() for one in [pool.submit(share) for _ in range(4)]]
    names = [f"{index:03d}.exr" for index in range(40)]
    assert sorted(rendered) == sorted(file.name for files in shares for file in files)
    assert sorted(rendered) == [name for name in names if name != "003.exr"]
    assert not (tmp_path / bridge.MANIFEST).exists()
    held.close()
    assert [file.name for file in bridge.render_shared(Counting(), path, tmp_path, "cycles")] == ["003.exr"]
    assert sorted(file.name for file in tmp_path.iterdir()) == [*names, bridge.MANIFEST]
    assert bridge.render_shared(Counting(), path, tmp_path, "cycles") == [] and len(rendered) == 40
    assert sorted(file.name for file in tmp_path.iterdir()) == [*names, bridge.MANIFEST]


def test_an_image_that_is_cut_off_is_never_taken_for_whole(scene, tmp_path, monkeypatch):
    conditions = ConditionScene(bumpy_room(), "cycles")

    def cut_off(*args, **given):
        (tmp_path / ".unfinished-000.exr").write_bytes(b"v/1")
        raise RuntimeError("no space left")

    monkeypatch.setattr(bridge, "_render_now", cut_off)
    with pytest.raises(GenerationError, match=r"000\.exr: .*no space left"):
        conditions.render(LENSES["centred"], tmp_path / "000.exr")
    assert not (tmp_path / "000.exr").exists()
    conditions.remove()


def test_another_camera_or_a_damaged_image_is_refused(in_cycles, tmp_path):
    with pytest.raises(GenerationError, match="size"):
        read_condition(in_cycles[1][0], PATH[-1])
    damaged = tmp_path / "000.exr"
    for content in (b"", b"no image", in_cycles[1][0].read_bytes()[:3000]):
        damaged.write_bytes(content)
        with pytest.raises(GenerationError, match=r"000\.exr"):
            read_condition(damaged, PATH[0])


def test_eevee_refuses_more_objects_than_it_can_number(scene):
    proxy = fake_bundle.proxy()
    proxy.instance[-1] = 5000
    with pytest.raises(GenerationError, match="objects"):
        ConditionScene(proxy, "eevee")


def test_both_sides_cut_off_at_the_same_near_plane():
    assert bridge.NEAR_M == rasterizer.NEAR_M


@pytest.mark.slow
def test_eevee_agrees_with_the_z_buffer(scene, tmp_path):
    files = render_conditions(bumpy_room(), PATH, tmp_path, "eevee")
    renderer = ZBufferRenderer(bumpy_room())
    for file, camera in zip(files, PATH, strict=True):
        found, expected = read_condition(file, camera), renderer.condition(camera)
        agrees(found, expected, depth_share=0.995, normal_share=0.995, flag_share=0.99)
        edges_within_one_pixel(found, expected)
