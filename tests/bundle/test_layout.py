"""What the files of captures are called: as ever for plain names, and plain ones for paths."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.bundle.layout import capture_files, mask_stems

NAMES = st.lists(st.text(st.sampled_from("aA0._/\\- é"), min_size=1, max_size=8), unique=True, max_size=12)


def test_plain_names_keep_their_files():
    names = ["00244.png", "IMG 1.JPG", "été.jpg", "Zimmer"]
    assert capture_files(names) == ["00244.png.npz", "IMG 1.JPG.npz", "été.jpg.npz", "Zimmer.npz"]
    assert list(mask_stems(names).values()) == ["00244", "IMG 1", "été", "Zimmer"]


def test_the_names_of_a_rig_are_made_plain():
    names = ["cam0/0000.png", "/photos/cam1/0000.png", "cam0_0000.png", "left.png"]
    files = ["cam0_0000.png_2.npz", "photos_cam1_0000.png.npz", "cam0_0000.png.npz", "left.png.npz"]
    assert capture_files(names) == files
    stems = ["cam0_0000.png_2", "photos_cam1_0000.png", "cam0_0000", "left"]
    assert list(mask_stems(names).values()) == stems


def test_captures_that_share_a_stem_have_masks_of_their_own():
    stems = mask_stems(["a.jpg", "a.png", "a.jpg.tif", "b.png"])
    assert stems == {"a.jpg": "a.jpg_2", "a.png": "a.png", "a.jpg.tif": "a.jpg", "b.png": "b"}


def test_a_long_path_gives_a_name_that_a_file_can_have(tmp_path):
    (file,) = capture_files(["/home/" + "deep/" * 60 + "0000.png"])
    (tmp_path / file).touch()
    assert file.endswith("deep_0000.png.npz")


def test_a_photographs_long_name_leaves_room_for_a_suffix(tmp_path):
    names = ["a" * 250 + ".png", "b" + "a" * 249 + ".png", "é" * 100 + ".png"]
    files = capture_files(names)
    for file in files:
        (tmp_path / file).touch()
    assert len(set(files)) == 3 and files[2] == names[2] + ".npz"


@given(NAMES)
def test_no_two_captures_share_a_file_and_none_leaves_the_folder(names):
    for stems in (capture_files(names), list(mask_stems(names).values())):
        assert len(set(stems)) == len(names)
        assert all(Path("folder", f"{stem}.png").parent == Path("folder") for stem in stems)
