"""The tab in a real Blender with its window: ``make window``, with BLENDER naming the Blender.

Pictures of every state are kept in build/window/.
"""

import json
import re
import shutil
from pathlib import Path

import display
import ellipsis_marks
import fake_asset
import numpy as np
import pytest
from fake_bundle import write_bundle
from PIL import Image
from stand_in_engine import write_stand_in_engine

from r2sego_blender.core.cameras import Camera
from r2sego_blender.splats.quaternions import to_rotation
from r2sego_blender.splats.rendering.outputs import render_batch

HERE = Path(__file__).parent
PICTURES = display.ROOT / "build" / "window"
SEARCHED = ("no_engine", "no_scene", "scene", "shown")
STATES = (*SEARCHED, "working", "settings")
SIZES = {1: (700, 7800), 2: (1000, 15600)}  # all panels open with everything they can hold
TIMED = ("cancelled", "left", "found")
TIMED_SIZE = (1100, 900)  # software GL draws a tall window too slowly to tell what the add-on takes
LEAST_BUTTONS = 40
LEAST_UNDONE = 40
WIDE_PX = 50  # a disc at most
CANCELLED_WITHIN_S = 2.0

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(display.missing()), reason=display.missing() or "all is here")]


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    """Folder with the zip, the bundle and the stand-in engine."""
    folder = tmp_path_factory.mktemp("window")
    display.build_zip(folder)
    write_stand_in_engine(folder)
    write_bundle(folder / "room.r2s")
    return folder


def arguments(folder):
    (package,) = folder.glob("*.zip")
    return [str(package), str(folder / "room.r2s"), str(folder / "engine" / "python")]


@pytest.fixture(scope="module")
def looked(material):
    """What was seen in a state at a scale, looked at once."""
    seen = {}

    def look(state, scale):
        if (state, scale) not in seen:
            out = material / f"{state}_{scale}x"
            size = TIMED_SIZE if state in TIMED else SIZES[scale]
            log = display.run(HERE / "look.py", out, *arguments(material), state, str(scale), size=size)
            assert (out / "told.json").is_file(), log[-3000:]
            PICTURES.mkdir(parents=True, exist_ok=True)
            picture = out / "picture.png"
            shutil.copy(picture, PICTURES / f"{out.name}.png")
            seen[state, scale] = (json.loads((out / "told.json").read_text()), picture, log)
        return seen[state, scale]

    return look


@pytest.fixture(scope="module")
def dots(looked):
    """How the end of a cut off text looks, at a scale."""
    kept = {}

    def found(scale):
        if scale not in kept:
            told, picture, _ = looked("cut", scale)
            kept[scale] = ellipsis_marks.templates(ellipsis_marks.bar_of(picture, told["bar"]), scale)
            assert len(kept[scale]) >= 8
        return kept[scale]

    return found


@pytest.mark.parametrize("scale", SIZES)
@pytest.mark.parametrize("state", SEARCHED)
def test_the_mouse_reaches_every_button_the_panels_draw(looked, state, scale):
    told, _, _ = looked(state, scale)
    assert len(told["drawn"]) > LEAST_BUTTONS
    assert told["met"] == told["drawn"]


@pytest.mark.parametrize("scale", SIZES)
def test_a_text_that_is_cut_off_would_be_found(looked, dots, scale):
    told, picture, _ = looked("cut", scale)
    found = ellipsis_marks.marks(ellipsis_marks.bar_of(picture, told["bar"]), dots(scale)[::2])
    assert len(found) >= 16


@pytest.mark.parametrize("scale", SIZES)
@pytest.mark.parametrize("state", STATES)
def test_no_text_is_cut_off(looked, dots, state, scale):
    told, picture, _ = looked(state, scale)
    found = ellipsis_marks.marks(ellipsis_marks.bar_of(picture, told["bar"]), dots(scale))
    assert found == [], f"{picture}: (x, y) in the bar: {found}"


def test_while_the_engine_works_it_can_be_cancelled_from_the_tab(looked):
    told, _, _ = looked("cancelled", 1)
    assert "bpy.ops.r2sego.cancel()" in told["drawn"]
    assert told["running"]
    assert not told["still_running"]
    assert told["cancelled_after_s"] < CANCELLED_WITHIN_S


def test_a_job_outlives_blender_is_found_again_and_ends_with_esc(looked):
    looked("left", 1)  # that Blender is closed
    told, _, _ = looked("found", 1)
    assert told["running"]
    assert not told["still_running"]
    assert told["cancelled_after_s"] < CANCELLED_WITHIN_S


@pytest.fixture(scope="module")
def pressed(material):
    """What came of pressing each button."""
    (material / "engine" / "conduct.txt").write_text("succeed")
    out = material / "press"
    bundle = material / "pressed" / "room.r2s"
    shutil.copytree(material / "room.r2s", bundle)
    package, _, engine = arguments(material)
    log = display.run(HERE / "press.py", out, package, str(bundle), engine, size=SIZES[1], timeout_s=1500.0)
    assert (out / "told.json").is_file(), log[-3000:]
    return json.loads((out / "told.json").read_text()), log


def did_its_work(call, came):
    """Whether what came of pressing, notes or a word, is that the button's operator answered."""
    return isinstance(came, list) and bool(came) and came[0][0] in call and all(n[2] != "raised" for n in came)


def test_every_button_that_is_not_grey_does_its_work_when_pressed(pressed):
    told, _ = pressed
    assert len(told["pressed"]) > LEAST_BUTTONS
    idle = {call: came for call, came in told["pressed"].items() if not did_its_work(call, came)}
    assert idle == {}


def test_what_was_pressed_can_be_undone_and_done_again(pressed):
    told, _ = pressed
    assert told["undone"] == told["redone"] > LEAST_UNDONE


def errors(log):
    """The tracebacks of a log, and Blender's own complaints about the add-on."""
    return re.findall(r"^(?:Traceback|Error: Python|.*rna_uiItem.*|.*unknown operator).*$", log, re.M)


@pytest.mark.parametrize("scale", SIZES)
@pytest.mark.parametrize("state", STATES)
def test_no_error_is_in_blenders_log(looked, state, scale):
    assert errors(looked(state, scale)[2]) == []


def test_no_error_is_in_blenders_log_after_pressing(pressed):
    assert errors(pressed[1]) == []


@pytest.fixture(scope="module")
def painted(material):
    """What Blender painted of the asset, times alpha, first row on top, and its matrices, by view."""
    out = material / "painted"
    log = display.run(HERE / "painted.py", out, *arguments(material))
    assert (out / "told.json").is_file(), log[-3000:]
    assert "drawn as discs" not in log
    told = json.loads((out / "told.json").read_text())
    rest = {name: told.pop(name) for name in ("middle_px", "left_half")}
    return {
        kind: {name: np.load(out / f"{kind}_{name}.npy")[::-1] for name in ("colours", "nearnesses")}
        | {name: np.array(matrix) for name, matrix in matrices.items()}
        for kind, matrices in told.items()
    } | rest


@pytest.mark.parametrize("kind", ["PERSP", "CLIPPED"])
def test_blender_paints_the_asset_as_the_engine_renders_it(painted, kind):
    seen, asset = painted[kind], shown_asset()
    picture, window = seen["colours"], seen["window"]
    height, width = picture.shape[:2]
    camera = Camera(
        width,
        height,
        0.5 * width * window[0, 0],
        0.5 * height * window[1, 1],
        0.5 * width * (1.0 - window[0, 2]),
        0.5 * height * (1.0 + window[1, 2]),
        np.linalg.inv(seen["view"]) @ np.diag([1.0, -1.0, -1.0, 1.0]),
    )
    if kind == "CLIPPED":
        planes = seen["kept"][:4]
        kept = (asset.means @ planes[:, :3].T + planes[:, 3] > 0.0).all(axis=1)
        assert 20 < kept.sum() < len(asset) - 20
        asset = asset.subset(kept)
    (rendering,) = render_batch(asset, [camera])
    assert rendering.alpha.max() > 0.9
    assert np.abs(picture[..., :3] - rendering.colour).max() < 0.01
    assert np.abs(picture[..., 3] - rendering.alpha).max() < 0.01


def test_what_was_painted_is_laid_over_the_view_and_nothing_else_changes(painted, material):
    seen = painted["PERSP"]
    alpha = seen["colours"][..., 3]
    height, width = alpha.shape
    left, bottom = seen["origin"]

    def screen(name):
        with Image.open(material / "painted" / f"{name}.png") as picture:
            pixels = np.asarray(picture.convert("RGB"), int)
        top = len(pixels) - bottom - height
        return pixels[top : top + height, left : left + width]

    changed = np.abs(screen("PERSP") - screen("without")).max(axis=-1)
    bare = slice(150, height - 50), slice(100, width - 400)  # of what Blender writes and of the side bars
    assert (alpha[bare] > 0.5).sum() > 100
    # The default cube, the points and cameras stand before some of them.
    assert (changed[bare][alpha[bare] > 0.5] > 3).mean() > 0.5
    assert (changed[bare][alpha[bare] == 0.0] > 3).mean() < 0.001


@pytest.mark.parametrize("drawn", ["discs", "points"])
def test_a_clipping_region_cuts_off_what_lies_beyond_it_and_a_local_view_all(painted, material, drawn):
    middle = painted["middle_px"]

    def seen(name):
        with Image.open(material / "painted" / f"{name}.png") as picture:
            return np.asarray(picture.convert("RGB"), int)[150:700]

    def places(where):
        off = np.abs(seen(f"{drawn}_{where}") - seen(f"nothing_{where}")).max(axis=-1) > 30
        return off[:, 100 : middle - WIDE_PX], off[:, middle + WIDE_PX : 2 * middle - 100]

    whole, clipped, local = map(places, ("whole", "clipped", "local"))
    assert min(part.sum() for part in whole) > 20
    assert (clipped[0] == whole[0]).mean() > 0.999 and clipped[0].sum() > 20
    assert not clipped[1].any() and not any(part.any() for part in local)


def test_a_lasso_marks_nothing_that_a_clipping_region_hides(painted, material):
    clipped, whole = (np.load(material / "painted" / f"held_{where}.npy") for where in ("clipped", "whole"))
    plane = np.array(painted["left_half"])
    shown = whole @ plane[:3] + plane[3] > 0.0
    assert shown.sum() > 20 and (~shown).sum() > 20
    np.testing.assert_array_equal(clipped, whole[shown])


def test_blender_paints_the_asset_without_perspective(painted):
    seen = painted["ORTHO"]
    picture = seen["colours"]
    height, width = picture.shape[:2]
    asset, clip = shown_asset(), seen["window"] @ seen["view"]
    to_pixels = np.diag([0.5 * width, -0.5 * height]) @ clip[:2]
    centres = asset.means @ to_pixels[:, :3].T + to_pixels[:, 3] + (0.5 * width, 0.5 * height)
    nearnesses = 0.5 - 0.5 * (asset.means @ clip[2, :3] + clip[2, 3])
    axes = to_rotation(asset.quaternions) * np.exp(asset.log_scales)[:, None]
    spread = to_pixels[:, :3] @ axes
    inverses = np.linalg.inv(spread @ spread.transpose(0, 2, 1) + 0.3 * np.eye(2))
    y, x = np.mgrid[:height, :width] + 0.5
    expected = np.zeros((height, width, 5))
    for k in np.argsort(nearnesses):
        away = np.stack([x - centres[k, 0], y - centres[k, 1]], axis=-1)
        alpha = asset.opacities[k] * np.exp(-0.5 * ((away @ inverses[k]) * away).sum(axis=-1))
        alpha = np.where(alpha >= 1.0 / 255.0, np.minimum(alpha, 0.99), 0.0)[..., None]
        expected = expected * (1.0 - alpha) + alpha * [*asset.base_colours[k], 1.0, nearnesses[k]]
    assert expected[..., 3].max() > 0.9
    assert np.abs(picture - expected[..., :4]).max() < 0.01
    some = expected[..., 3] > 0.02
    sums, weighted = seen["nearnesses"][some], expected[some]
    off = np.abs(sums[:, 0] / sums[:, 1] - weighted[:, 4] / weighted[:, 3])
    off_m = off * 2.0 / np.linalg.norm(clip[2, :3])
    assert np.median(off_m) < 0.001 and off_m.max() < 0.05


def shown_asset():
    """The final asset of the fake bundle without its backdrop and what depends on the direction."""
    whole = fake_asset.asset(3).with_degree(0)
    whole.sh[:, 0] = np.clip(whole.sh[:, 0], -1.7, 1.7)  # colours in [0, 1], as Blender shows them
    return whole
