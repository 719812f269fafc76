"""Poses are found at a place, of whatever kind; a new kind is one file."""

import json

import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses import formats, registry
from r2sego_blender.captures.poses.dropped_files import capture_files
from r2sego_blender.captures.poses.registry import FORMATS, find_export, find_poses, poses_beside
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.refine.splat_start import holds_poses

NEW_KIND = """
from ..pose_format import PoseFormat, Posed

def find(place):
    file = place / "flight.log" if place.is_dir() else place
    return [file] if file.suffix == ".log" and file.is_file() else []

def read(file, folder, settings, progress):
    import numpy as np
    from ...lenses.lens import Lens
    from ..photographs import Photograph

    photographs = []
    for line in file.read_text().splitlines():
        name, height = line.split()
        pose = np.eye(4)
        pose[2, 3] = float(height)
        photographs.append(Photograph(name, folder / name, Lens(64, 48, 50, 50, 32, 24), pose, line))
    return Posed(photographs, FORMAT.name, metric=True)

FORMAT = PoseFormat("flight log", find, read, files=("flight.log",))
"""


def written(folder, *files):
    """The folder with each file: a JSON object with the key that is given after ":", or nothing."""
    for file in files:
        name, _, key = file.partition(":")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(json.dumps({key: []}) if key else "")
    return folder


MODEL = ("sparse/0/cameras.bin", "sparse/0/images.bin")
FILES = ("transforms.json:frames", "cameras.json:captures")
EXPORT = ("keyframes/cameras/1.json:t_00", "keyframes/images/1.jpg")


@pytest.mark.parametrize(
    ("files", "given", "beside"),
    [
        ((*MODEL, *EXPORT, *FILES), "sparse/0", "cameras.json"),
        ((*EXPORT, *FILES), "keyframes", "cameras.json"),
        (FILES, "cameras.json", "cameras.json"),
        (("cameras.json:of 3DGS", FILES[0]), "transforms.json", "transforms.json"),
        (("cameras.json", FILES[0]), "cameras.json", "cameras.json"),  # damaged: its reader says so
        (("transforms_train.json:frames", *MODEL), "sparse/0", "transforms_train.json"),
        ((*MODEL, *EXPORT), "sparse/0", "sparse/0"),
        (EXPORT, "keyframes", "keyframes"),
    ],
)
def test_of_several_kinds_in_a_folder_one_is_taken(tmp_path, files, given, beside):
    """A folder given as the poses, and one of photographs, where a file goes before a model."""
    written(tmp_path, *files)
    assert find_poses(tmp_path)[1] == tmp_path / given
    assert poses_beside(tmp_path) == [tmp_path / beside]


def test_a_file_is_known_by_what_it_holds(tmp_path):
    written(tmp_path, "a.json:frames", "b.json:captures", "c.json:views", *MODEL)
    kinds = {name: find_poses(tmp_path / name)[0].name for name in ("a.json", "b.json", *MODEL)}
    assert set(kinds.values()) == {"transforms.json", "cameras.json", "COLMAP model"}
    assert kinds[MODEL[0]] == kinds[MODEL[1]] == "COLMAP model"
    assert holds_poses(tmp_path / "a.json") and not holds_poses(tmp_path / "b.json")


FOREIGN = {
    "cameras.csv": "#name,x,y,alt,heading,pitch,roll\nIMG_1.jpg,0,1,2,3,4,5\n",  # RealityScan
    "cameras.xml": '<?xml version="1.0"?><document version="2.0.0"><chunk/></document>',  # Metashape
    "bundle.out": "# Bundle file v0.3\n1 0\n1600 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n",  # Bundler
    "groundtruth.txt": "# timestamp tx ty tz qx qy qz qw\n1305031098.6 1 2 3 0 0 0 1\n",  # TUM
    "reconstruction.json": '[{"cameras": {}, "shots": {}, "points": {}}]',  # OpenSfM
    "meta_data.json": '{"camera_model": "OPENCV", "frames": [{"rgb_path": "0.png", "camtoworld": []}]}',  # sdfstudio
    "list.json": "[1, 2]",
    "views.json": '{"views": []}',
    "number.json": "12",
}


@pytest.mark.parametrize("name", FOREIGN)
def test_poses_of_another_program_are_told_what_is_accepted(tmp_path, name):
    (tmp_path / name).write_text(FOREIGN[name])
    with refused(CaptureError, tmp_path / name, cure=FORMATS[0].name) as caught:
        find_poses(tmp_path / name)
    assert all(record.name in caught.value.cure for record in FORMATS)


@pytest.mark.parametrize("content", ["", '{"captures": [', '{"captures": [], "fx": NaN}'])
def test_a_damaged_file_is_not_told_to_be_of_another_kind(tmp_path, content):
    (tmp_path / "cameras.json").write_text(content)
    with refused(CaptureError, tmp_path / "cameras.json", "not JSON", cure="export") as caught:
        find_poses(tmp_path / "cameras.json")
    assert FORMATS[0].name not in caught.value.cure


def test_a_folder_of_poses_whose_photographs_lie_below_is_taken_with_them(tmp_path, blank_photograph):
    """nerfstudio's and COLMAP's layout; with photographs of its own they would have to be named."""
    written(tmp_path, "cameras.json:captures", *MODEL)
    blank_photograph(tmp_path / "images" / "0.png")
    assert find_export(tmp_path)[1] == tmp_path / "cameras.json"
    (tmp_path / "cameras.json").unlink()
    assert find_export(tmp_path)[1] == tmp_path / "sparse" / "0"
    blank_photograph(tmp_path / "cover.png")
    assert find_export(tmp_path) is None
    (tmp_path / "cover.png").unlink()
    written(tmp_path, *(file.replace("/0/", "/1/") for file in MODEL))
    with refused(CaptureError, tmp_path, "2 models"):
        find_export(tmp_path)


def test_a_folder_without_poses_names_every_kind(tmp_path):
    for place in (tmp_path, tmp_path / "images.bin"):
        with refused(CaptureError, tmp_path) as caught:
            find_poses(place)
        assert all(record.name in str(caught.value) for record in FORMATS)
        assert caught.value.where == str(tmp_path)
    assert poses_beside(tmp_path) == ()


def test_a_new_kind_is_one_file(tmp_path, monkeypatch, blank_photograph):
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "flight_log.py").write_text(NEW_KIND)
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path / "new")])
    monkeypatch.setattr(registry, "FORMATS", registry._records())
    room = tmp_path / "attic"
    for index in range(3):
        blank_photograph(room / "images" / f"{index}.png", 64, 48)
    (room / "flight.log").write_text("".join(f"{index}.png {index / 4}\n" for index in range(3)))
    for poses in (room, room / "flight.log"):
        imported = import_captures(room / "images", poses, CaptureSettings())
        assert imported.source == "flight log" and imported.metric
        heights = [capture.camera.centre[2] for capture in imported.captures]
        np.testing.assert_allclose(heights, [0, 0.25, 0.5])
    for dropped in (room, room / "flight.log"):
        found = capture_files([dropped], ".r2s")
        assert (found.photographs, found.poses) == (room / "images", room / "flight.log")
