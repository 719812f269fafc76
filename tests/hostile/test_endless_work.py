"""Small files that would keep a reader for hours, or start a program: each is refused, or read, at once."""

from __future__ import annotations

import io
import os
import struct
import time
import zipfile
from collections.abc import Callable
from pathlib import Path, PurePath

import numpy as np
import pytest
from PIL import Image

from r2sego_blender.bundle.journal import Journal
from r2sego_blender.captures.archives import unpack
from r2sego_blender.captures.poses.finding import find_photographs
from r2sego_blender.captures.poses.plain_folder import plain_photographs
from r2sego_blender.captures.poses.ply_points import read_ply_points
from r2sego_blender.config.declared_files import parse_toml
from r2sego_blender.core.arrays import arrays_of
from r2sego_blender.core.errors import CaptureError, R2SEgoError
from r2sego_blender.core.images import load_image, stored_values
from r2sego_blender.core.progress import SILENT
from r2sego_blender.evaluation.figures import save_figure
from r2sego_blender.robot.model.robot_file import gather_robot
from r2sego_blender.trials.records.index import RecordIndex

MOST_S = 2.0  # of the processor; each took from ten seconds to hours
SIDE = 2048


def jpeg_of_scans(count: int) -> bytes:
    """A grey progressive JPEG, of which so many scans say that nothing is to be added to its blocks."""
    made = io.BytesIO()
    Image.new("L", (SIDE, SIDE), 128).save(made, "JPEG", progressive=True)
    data = made.getvalue()
    first = data.index(b"\xff\xda")
    ends = next(place for place in range(first + 2, len(data)) if data[place] == 0xFF and data[place + 1] == 0xC4)
    table = b"\xff\xc4" + struct.pack(">H", 20) + b"\x10" + bytes([1] + [0] * 15) + b"\xe0"  # one word: skip blocks
    words = ("0" + "1" * 14) * ((SIDE // 8) ** 2 // 32767 + 1)
    words += "1" * (-len(words) % 8)
    packed = int(words, 2).to_bytes(len(words) // 8, "big").replace(b"\xff", b"\xff\0")
    scan = table + b"\xff\xda" + struct.pack(">H", 8) + b"\x01\x01\x00\x01\x3f\x00" + packed
    return data[:ends] + scan * count + b"\xff\xd9"


def zip_of_a_list(entries: int, comment: bytes = b"") -> bytes:
    """An archive without files that lists so many, and says so to zip64 alone."""
    listed = entries * (b"PK\1\2" + struct.pack("<6H3I5H2I", 20, 20, *[0] * 7, 1, *[0] * 6) + b"a")
    record = b"PK\6\6" + struct.pack("<QHHIIQQQQ", 44, 45, 45, 0, 0, entries, entries, len(listed), 0)
    locator = b"PK\6\7" + struct.pack("<IQI", 0, len(listed), 1)
    return listed + record + locator + b"PK\5\6" + struct.pack("<4H2IH", 0, 0, 1, 1, 47, 0, len(comment)) + comment


def photograph(tmp_path: Path) -> None:
    (tmp_path / "c.jpg").write_bytes(jpeg_of_scans(20_000))
    assert stored_values(tmp_path / "c.jpg") is None
    load_image(tmp_path / "c.jpg")


def archive(tmp_path: Path, comment: bytes = b"") -> None:
    (tmp_path / "scan.zip").write_bytes(zip_of_a_list(900_000, comment))
    (tmp_path / "out").mkdir()
    unpack(tmp_path / "scan.zip", tmp_path / "out", SILENT)


def archive_with_a_comment(tmp_path: Path) -> None:
    archive(tmp_path, b"." * 65_535)


def arrays(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(zip_of_a_list(900_000))
    with pytest.raises(zipfile.BadZipFile), arrays_of(tmp_path / "a.npz"):
        pass
    raise R2SEgoError("", where="a.npz", cure=".")


def declaration(text: str) -> Callable[[Path], None]:
    def parse(_: Path) -> None:
        with pytest.raises(ValueError):
            parse_toml(text)
        raise R2SEgoError("", where=".", cure=".")

    return parse


def package(tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<!--" * 200_000)
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="l"><collision><geometry><mesh filename="package://r/a.stl"/>'
        "</geometry></collision></link></robot>"
    )
    gather_robot(tmp_path / "r.urdf")


def names_of_poses(tmp_path: Path) -> None:
    for index in range(2000):
        (tmp_path / f"{index}.png").touch()
    find_photographs([f"a{index}.png" for index in range(3000)], (tmp_path,), "transforms.json", SILENT)


def lines(file: str, read: Callable[[Path], object]) -> Callable[[Path], None]:
    def written(tmp_path: Path) -> None:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text('{"step": 1}\n' * 1_000_000)
        read(tmp_path)

    return written


@pytest.mark.parametrize(
    "read",
    [
        photograph,
        archive,
        archive_with_a_comment,
        arrays,
        declaration('x = "' + '\\"' * 60_000),
        declaration('x = """\n' + '\\"""\n' * 60_000),
        declaration("x = '''" + "''a" * 60_000),
        declaration('x = "' + "\\" * 120_001),
        package,
        names_of_poses,
        lines("journal.jsonl", lambda folder: Journal(folder).steps()),
        lines("records/index.jsonl", lambda folder: RecordIndex(folder).entries()),
    ],
    ids=[
        "JPEG",
        "zip",
        "zip's comment",
        "NPZ",
        "text",
        "lines",
        "raw",
        "strokes",
        "package.xml",
        "names",
        "journal",
        "index",
    ],
)
def test_work_without_end_is_refused(tmp_path, read):
    begun_s = time.process_time()
    with pytest.raises(R2SEgoError) as refused:
        read(tmp_path)
    assert time.process_time() - begun_s <= MOST_S
    assert refused.value.where and refused.value.cure


def test_depth_maps_and_copies_are_not_sought_among_all_others(tmp_path, monkeypatch):
    for kind, mode in enumerate(("L", "I;16")):
        made = io.BytesIO()
        Image.new(mode, (8, 6)).save(made, "PNG")
        for index in range(200):
            (tmp_path / f"{index:04d}_{kind}.png").write_bytes(made.getvalue())
    equal, compared = PurePath.__eq__, []
    monkeypatch.setattr(PurePath, "__eq__", lambda path, other: compared.append(path) or equal(path, other))
    with pytest.raises(CaptureError, match="1 photograph found"):
        plain_photographs(tmp_path, SILENT)
    assert len(compared) < 20 * 400  # each with all others would be more than 60,000


def test_a_jpeg_of_a_few_scans_and_a_video_behind_it_is_a_photograph(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, 1 << 18, np.uint8).tobytes()
    (tmp_path / "c.jpg").write_bytes(jpeg_of_scans(40) + b"\xff\xda" * 1000 + noise)
    assert load_image(tmp_path / "c.jpg").shape == (SIDE, SIDE, 3)
    assert stored_values(tmp_path / "c.jpg") is not None


def test_text_that_ends_in_quotes_hides_no_tables():
    for quote in "\"'":
        assert parse_toml(f"x = {quote * 3}a{quote * 5}\ny = 1") == {"x": f"a{quote * 2}", "y": 1}
        with pytest.raises(ValueError, match="nested"):
            parse_toml(f"x = [{quote * 3}a{quote * 4}, {'[' * 40}{quote}")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of other systems")
def test_a_picture_that_points_name_is_not_opened(tmp_path, capfd):
    os.mkfifo(tmp_path / "picture")  # it would never end
    properties = "".join(f"property float {name}\n" for name in "xyzst")
    (tmp_path / "p.ply").write_text(
        f"ply\nformat ascii 1.0\ncomment TextureFile picture\nelement vertex 3\n{properties}element face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 0 1\n0 1 0 1 1\n3 0 1 2\n"
    )
    assert len(read_ply_points(tmp_path / "p.ply")[0]) == 3
    assert not capfd.readouterr().err
    os.mkfifo(tmp_path / "q.ply")
    with pytest.raises(CaptureError, match=r"q\.ply"):
        read_ply_points(tmp_path / "q.ply")


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands for Ghostscript")
def test_a_picture_of_a_bundle_starts_no_program(tmp_path, monkeypatch):
    """Pillow has Ghostscript draw what begins as EPS, whatever the file is called."""
    program = tmp_path / "gs"
    program.write_text(f"#!/bin/sh\ntouch {tmp_path / 'ran'}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "frame.png").write_text(
        "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n%%EOF\n"
    )
    with pytest.raises(CaptureError, match=r"frame\.png"):
        save_figure(tmp_path / "a.jpg", tmp_path / "frame.png")
    assert not (tmp_path / "ran").exists()
