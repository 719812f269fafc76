"""The chosen generator: what a machine has of it, and the loop with a program."""

import json
import sys
from pathlib import Path

import box_room
import numpy as np
import pytest

from r2sego_blender.config.presets import with_overrides
from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GenerationError, MachineError, NativeError
from r2sego_blender.core.images import load_image, resize
from r2sego_blender.generation.conditions.condition_files import load_conditions
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.conditions.point_condition import PointConditions
from r2sego_blender.generation.ego_views import ego_video_reg, load_pseudo_observations
from r2sego_blender.generation.generators import viewcrafter
from r2sego_blender.generation.generators.blending import BlendingGenerator
from r2sego_blender.generation.generators.command import COMMAND_VARIABLE, SIZE_VARIABLE
from r2sego_blender.generation.generators.program import letterbox
from r2sego_blender.generation.generators.registry import installation_of, open_generator
from r2sego_blender.generation.generators.slot import ClipInputs
from r2sego_blender.generation.paths.paths import camera_path
from r2sego_blender.generation.registration.frame_registration import Landmarks
from r2sego_blender.views.references import with_references
from r2sego_blender.views.selection import select_targets
from r2sego_blender.workers.child import RUNNING
from r2sego_blender.workers.generator_program import PROTOCOL

SETTINGS = with_overrides(
    {
        "selection.target_views": 1,
        "generation.clip_frames": 3,
        "generation.clip_scale": 0.25,
        "generation.max_replacements": 1,
        "generation.generator": "command",
    }
)

ANSWERING = """
import json, pathlib, shutil, sys
import numpy as np
from PIL import Image
folder = pathlib.Path(sys.argv[1])
shutil.copytree(folder, KEPT)
request = json.loads((folder / "request.json").read_text())
size = request["width"], request["height"]
(folder / "frames").mkdir()
for k in range(request["frames"]):
    pixels = np.array(Image.open(folder / "conditions" / f"{k:03d}_points.png"))
    gaps = ~pixels.any(axis=2)
    pixels[gaps] = pixels[~gaps].mean(axis=0)
    Image.fromarray(pixels).save(folder / "frames" / f"{k:03d}.png")
result = {"protocol": request["protocol"], "backend": "Stand-in 2.1", "frames": request["frames"]}
"""
TELLING = '(folder / "result.json").write_text(json.dumps(result))\n'


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """The box room photographed at 480 x 360, and a target between two captures."""
    captures, depths = box_room.write_captures(tmp_path_factory.mktemp("room"), box_room.arc(4, 480, 360))
    target = box_room.lens(480, 360).at(look_at([0.1, -1.5, 1.3], [0.0, 0.5, 0.6]))
    return captures, depths, target


@pytest.fixture
def generator_in(tmp_path, monkeypatch):
    """Writes a stand-in program and names it; where it leaves what it was asked."""
    monkeypatch.delenv(SIZE_VARIABLE, raising=False)
    kept = tmp_path / "kept"

    def name(body=ANSWERING + TELLING):
        script = tmp_path / "my generator.py"
        script.write_text(body.replace("KEPT", repr(str(kept))))
        monkeypatch.setenv(COMMAND_VARIABLE, f"{sys.executable} '{script}'")
        return kept

    return name


def opened(room, scratch, settings=SETTINGS, planned=None):
    captures, depths, _ = room
    colours = PointConditions(captures, depths, settings.generation)
    renderer = ZBufferRenderer(box_room.proxy())
    inputs = ClipInputs(captures, depths, depths, renderer, colours, settings, scratch)
    return open_generator(planned or installation_of(settings), inputs)


def conditions_of(room):
    captures, _, target = room
    path = camera_path(captures[1].camera, target, 3)
    return ZBufferRenderer(box_room.proxy()).render((*(c.scaled(0.25) for c in path[:-1]), path[-1]))


def test_the_embedded_one_is_the_default(room, tmp_path):
    with opened(room, tmp_path, Settings()) as generator:
        assert isinstance(generator, BlendingGenerator)


@pytest.mark.parametrize("size", ["", "1024x576"])
def test_a_program_is_asked_for_its_size_and_answers_at_the_conditions(room, generator_in, tmp_path, monkeypatch, size):
    captures, _, target = room
    kept = generator_in()
    monkeypatch.setenv(SIZE_VARIABLE, size)
    conditions = conditions_of(room)
    with opened(room, tmp_path) as generator:
        assert "my generator.py" in generator.name
        frames = generator.generate(1, conditions)
        assert generator.name == "Stand-in 2.1"
    assert not RUNNING
    assert [frame.image.shape for frame in frames] == [(90, 120, 3), (90, 120, 3), (360, 480, 3)]
    truth, _ = box_room.render(target)
    assert box_room.psnr(frames[-1].image, truth) > 23
    assert np.abs(frames[0].image - resize(captures[1].image(), 120, 90)).mean() < 0.01
    for frame, condition in zip(frames, conditions, strict=True):
        assert frame.confidence.dtype == np.float32
        expected = np.where(condition.validity >= 0.5, 1.0, SETTINGS.generation.hole_confidence)
        np.testing.assert_allclose(frame.confidence, expected)

    request = json.loads((kept / "request.json").read_text())
    width, height = (1024, 576) if size else (480, 360)
    assert (request["protocol"], request["frames"], request["seed"]) == (PROTOCOL, 3, SETTINGS.seed)
    assert (request["width"], request["height"]) == (width, height)
    assert request["reference"]["name"] == captures[1].name
    assert request["reference"]["camera"] == captures[1].camera.to_json()
    np.testing.assert_array_equal(load_image(kept / "reference.png"), captures[1].image())
    cameras = [Camera.from_json(camera) for camera in request["cameras"]]
    assert all(camera.shape == (height, width) for camera in cameras)
    np.testing.assert_array_equal(cameras[-1].world_from_camera, target.world_from_camera)
    for camera, motion in zip(cameras, request["reference_from_frame"], strict=True):
        back = captures[1].camera.world_from_camera @ np.array(motion)
        np.testing.assert_allclose(back, camera.world_from_camera, atol=1e-12)
    given = load_conditions(kept / "conditions")
    assert [condition.camera.to_json() for condition in given] == request["cameras"]
    # the first condition is the reference image itself, in the middle
    box = letterbox(target, width, height)
    own = resize(captures[1].image(), box.view_width, box.view_height)
    assert np.abs(box.cut(load_image(kept / "conditions" / "000_points.png")) - own).max() < 0.03


def test_a_program_may_tell_its_confidence(room, generator_in, tmp_path):
    generator_in(
        ANSWERING + '(folder / "confidence").mkdir()\nhalf = np.zeros(size[::-1], np.uint8)\n'
        "half[:, : size[0] // 2] = 204\n"
        'Image.fromarray(half).save(folder / "confidence" / "002.png")\n' + TELLING
    )
    with opened(room, tmp_path) as generator:
        frames = generator.generate(1, conditions_of(room))
    np.testing.assert_allclose(frames[2].confidence[:, :240], 0.8, atol=1e-6)
    assert not frames[2].confidence[:, 240:].any()
    assert frames[1].confidence.max() == 1.0


@pytest.mark.parametrize(
    ("mend", "said"),
    [
        ("(folder / 'frames' / '002.png').unlink()", r"left no frames/002\.png: the image is missing"),
        ("(folder / 'frames' / '001.png').write_bytes(b'x')", r"left no frames/001\.png: the image cannot"),
        (
            "Image.new('RGB', (9, 8)).save(folder / 'frames' / '000.png')",
            r"made frames/000\.png 9x8 pixels, not 480x360\. Mend it, or use --set generation\.gener",
        ),
        ("result['frames'] = 2", r"made 2 frames, not 3\."),
        ("result['frames'] = '3'", r"made '3' frames, not 3\."),
    ],
)
def test_an_answer_that_is_not_whole_is_told_in_a_line(room, generator_in, tmp_path, mend, said):
    generator_in(ANSWERING + mend + "\n" + TELLING)
    with (
        opened(room, tmp_path) as generator,
        pytest.raises(GenerationError, match=f"^Stand-in 2.1: the generator {said}") as caught,
    ):
        generator.generate(1, conditions_of(room))
    assert "\n" not in str(caught.value) and not RUNNING


def test_what_is_not_set_up_is_told_before_anything_is_made(room, tmp_path, monkeypatch):
    monkeypatch.delenv(COMMAND_VARIABLE, raising=False)
    monkeypatch.delenv(viewcrafter.PYTHON_VARIABLE, raising=False)
    with pytest.raises(MachineError, match=r"no generator is named\. Set R2SEGO_GENERATOR"), opened(room, tmp_path):
        pass
    for name in viewcrafter.SIZES:
        learned = with_overrides({"generation.generator": name})
        with pytest.raises(MachineError, match="ViewCrafter is not set up"), opened(room, tmp_path, learned):
            pass


def test_the_embedded_one_leaves_keys_as_they_are():
    assert installation_of(Settings()).identity == {}


def test_what_is_opened_is_what_the_key_says(room, generator_in, tmp_path, monkeypatch):
    """The environment is read when the step is planned, and not again."""
    generator_in()
    planned = installation_of(SETTINGS)
    monkeypatch.setenv(COMMAND_VARIABLE, "no-such-program")
    monkeypatch.setenv(SIZE_VARIABLE, "8x8")
    with opened(room, tmp_path, planned=planned) as generator:
        assert generator.generate(1, conditions_of(room))[-1].image.shape == (360, 480, 3)
    unknown = installation_of(SETTINGS)
    assert unknown.identity is None and isinstance(unknown.missing, MachineError)


def ego_views(room, folder):
    captures, depths, target = room
    renderer = ZBufferRenderer(box_room.proxy())
    candidates = [target, target.at(look_at([-0.2, -1.5, 1.2], [0.0, 0.5, 0.6]))]
    selection = select_targets(np.array([0.8, 0.7]), np.ones(2), np.arange(2), np.zeros(2), SETTINGS.selection)
    selection = with_references(
        selection, candidates, [capture.camera for capture in captures], renderer.depth, SETTINGS.selection, 2
    )
    folder.mkdir()
    with opened(room, folder) as generator:
        return ego_video_reg(
            selection,
            candidates,
            captures,
            renderer,
            generator,
            Landmarks.build(captures, depths),
            SETTINGS,
            folder,
            colours=PointConditions(captures, depths, SETTINGS.generation),
        )


def test_the_loop_runs_with_a_program(room, generator_in, tmp_path):
    generator_in()
    (view,) = ego_views(room, tmp_path / "views")
    assert view.rank == 0
    assert np.linalg.norm(view.camera.centre - room[2].centre) < 0.03
    folder = tmp_path / "views" / "000"
    record = json.loads((folder / "pose.json").read_text())
    assert record["generator"] == "Stand-in 2.1" and record["accepted"]
    assert len(list((folder / "clip").glob("*.png"))) == 3
    assert [path.name for path in (tmp_path / "views").iterdir()] == ["000"]
    assert not RUNNING


def test_a_clip_that_is_refused_is_replaced(room, generator_in, tmp_path):
    once = f"""
import json, pathlib, sys
folder, seen = pathlib.Path(sys.argv[1]), pathlib.Path({str(tmp_path / "seen")!r})
if not seen.exists():
    seen.write_text("")
    (folder / "result.json").write_text('{{"protocol": 1, "refused": "too dark"}}')
    sys.exit()
"""
    generator_in(once + ANSWERING + TELLING)
    observations = ego_views(room, tmp_path / "views")
    first = reasons(tmp_path / "views")[0]
    assert first.startswith("rejected: ") and "the generator refused, too dark" in first
    assert [view.rank for view in observations] == [1]
    assert load_pseudo_observations(tmp_path / "views")[0].rank == 1


def reasons(folder: Path) -> list[str]:
    return [json.loads(file.read_text())["reason"] for file in sorted(folder.glob("*/pose.json"))]


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("sys.exit('out of memory')", "ended with exit status 1. "),
        ("os.kill(os.getpid(), 9)", "the generator "),
        ('(folder / \'result.json\').write_text(\'{"protocol": 3, "backend": "x", "frames": 3}\')', "protocol 3"),
    ],
)
def test_a_program_that_breaks_once_costs_one_view(room, generator_in, tmp_path, broken, said):
    once = f"""
import os, pathlib, sys
folder, seen = pathlib.Path(sys.argv[1]), pathlib.Path({str(tmp_path / "seen")!r})
if not seen.exists():
    seen.write_text("")
    {broken}
    sys.exit()
"""
    generator_in(once + ANSWERING + TELLING)
    observations = ego_views(room, tmp_path / "views")
    assert [view.rank for view in observations] == [1]
    first = reasons(tmp_path / "views")[0]
    assert first.startswith("rejected: ") and said in first and "my generator.py" in first
    assert not list((tmp_path / "views" / "000").glob("*.png"))  # nothing of it is kept
    assert not RUNNING


def test_a_program_that_always_breaks_is_named_and_then_stops_the_round(room, generator_in, tmp_path):
    generator_in("import sys; sys.exit('no weights')")
    assert ego_views(room, tmp_path / "views") == ()
    assert all("Its last words: no weights" in reason for reason in reasons(tmp_path / "views"))
    with opened(room, tmp_path) as generator:
        for kind in (GenerationError, GenerationError, NativeError):
            with pytest.raises(kind, match=r"ended with exit status 1\. .*Its last words: no weights$"):
                generator.generate(1, conditions_of(room))
    assert not RUNNING
