"""The benchmark of the splats says everything it promises; how fast it is is no test's matter."""

import json

import numba
import numpy as np
import pytest
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.splats.formats.registry import save_asset
from tools.benchmarks.figures import write_figures
from tools.benchmarks.pairs import Work
from tools.benchmarks.splats import Rates, bench_splats, floor_ms, lines
from tools.benchmarks.workloads import made_up_room

POSITIVE = (
    "forward_cpu_ms",
    "step_cpu_ms",
    "loss_cpu_ms",
    "backward_cpu_ms",
    "floor_cpu_ms",
    "peak_rss_mb",
    "pairs_per_s",
    "gaussians",
    "visible",
    "contributing",
    "pairs",
    "threads",
    "repeats",
    "views",
    "forward_wall_ms",
    "step_wall_ms",
    "loss_wall_ms",
    "forward_cpu_ms_min",
    "step_cpu_ms_min",
    "loss_cpu_ms_min",
    "step_wall_ms_min",
    "fma_rate_per_s",
    "bandwidth_bytes_per_s",
    "step_over_floor",
)


@pytest.fixture(scope="module")
def figures() -> dict:
    return bench_splats(400, size="70x50", repeats=2)


def test_all_figures_are_there_and_positive(figures):
    assert all(figures[name] > 0 for name in POSITIVE)
    assert figures["size"] == "70x50" and figures["gaussians"] == 400
    assert figures["machine"] and figures["isa"]


def test_the_least_is_not_above_the_median_and_parts_make_the_step(figures):
    for part in ("forward", "loss", "backward", "step"):
        assert figures[f"{part}_cpu_ms_min"] <= figures[f"{part}_cpu_ms"]
    assert figures["step_cpu_ms_min"] >= sum(
        figures[f"{part}_cpu_ms_min"] for part in ("forward", "loss", "backward")
    ) * (1 - 1e-9)


def test_figures_can_be_written_and_read_by_a_person(figures, tmp_path):
    write_figures(tmp_path / "figures.json", figures)
    assert json.loads((tmp_path / "figures.json").read_text()) == figures
    text = "\n".join(lines(figures))
    assert "400 Gaussians at 70x50" in text and "floor" in text
    with pytest.raises(SettingsError, match="nowhere"):
        write_figures(tmp_path / "nowhere" / "figures.json", figures)


def test_an_asset_is_measured_on_the_views_of_its_cameras(tmp_path):
    room = made_up_room(300, (64, 48))
    save_asset(tmp_path / "asset.ply", room.asset)
    save_image(tmp_path / "a.png", room.views[0].image())
    capture = Capture("a.png", tmp_path / "a.png", room.views[0].camera)
    save_cameras_json(tmp_path / "cameras.json", [capture, capture])
    figures = bench_splats(asset=tmp_path / "asset.ply", cameras=tmp_path / "cameras.json", repeats=1)
    assert figures["views"] == 2 and figures["pairs"] > 0 and figures["size"] == "64x48"
    assert figures["pairs"] == bench_splats(300, size="64x48", repeats=1)["pairs"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": "big"}, "640x480"),
        ({"gaussians": 0}, "too few"),
        ({"repeats": 0}, "too few"),
        ({"threads": 0}, "cannot be had"),
        ({"threads": 100000}, "cannot be had"),
        ({"asset": "asset.ply"}, "do not fit"),
        ({"asset": "asset.ply", "cameras": "c.json", "gaussians": 5}, "do not fit"),
    ],
)
def test_options_that_cannot_work_are_refused(options, words):
    before = numba.get_num_threads()
    with pytest.raises(SettingsError, match=words):
        bench_splats(**options)
    assert numba.get_num_threads() == before


def test_the_floor_is_arithmetic_on_the_peaks():
    camera = made_up_room(1, (160, 120)).views[0].camera
    floor = floor_ms(Work(900, 800, 16_000_000), camera, 59, Rates(50e6, 1e9))
    assert floor["floor_raster_cpu_ms"] == pytest.approx(1000.0)
    assert floor["floor_loss_cpu_ms"] == pytest.approx(160 * 120 * 3 / 16 * 204 / 50e6 * 1e3)
    assert floor["floor_traffic_cpu_ms"] == pytest.approx((800 * 59 * 7 + 160 * 120 * 20) * 4 / 1e9 * 1e3)
    parts = [value for name, value in floor.items() if name != "floor_cpu_ms"]
    assert floor["floor_cpu_ms"] == pytest.approx(np.sum(parts))
