"""Keyframes of videos as phones write them, and of folders; and what is no video."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from expected_errors import refused
from phone_videos import PHONE_VIDEO, filmed, write_video

from r2sego_blender.captures.keyframes import video_frames
from r2sego_blender.captures.keyframes.choosing import Keyframe, photograph_keyframes, video_keyframes
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import load_image_uint8, save_image
from r2sego_blender.workers.child import call_in_child, kill_children

COUNT = 40
SHAKES = [index for index in range(COUNT) if index % 5 in (1, 2)]


@pytest.fixture(scope="module")
def frames(room):
    return filmed(room.image, COUNT, SHAKES)


@pytest.fixture(scope="module")
def video(frames, tmp_path_factory):
    return write_video(tmp_path_factory.mktemp("video") / "walk (1).mp4", frames)


def apart(path, frame):
    """How far the brightness of a file's picture is from a frame's, in levels: colours lose half their pixels."""
    image = load_image_uint8(path)
    return np.abs((image.astype(float) - frame).mean(axis=2)).mean() if image.shape == frame.shape else np.inf


def test_sharp_frames_along_the_whole_walk_are_taken_upright_and_told(video, frames, tmp_path, messages):
    taken = video_keyframes(video, tmp_path, 7, messages)
    numbers = [one.number for one in taken]
    assert len(numbers) == 7 and numbers == sorted(set(numbers))
    assert not set(numbers) & set(SHAKES)
    assert numbers[0] <= 5 and numbers[-1] >= COUNT - 6
    assert max(np.diff(numbers)) <= 15
    for one in taken:
        assert one.time_s == pytest.approx(one.number / 10.0, abs=0.01)
        right = [apart(one.path, frame) for frame in frames]
        assert np.argmin(right) == one.number and right[one.number] < 8.0
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"walk__1__{number:06d}.png" for number in numbers]
    assert all(str(one) in messages.messages[-1][1] for one in taken)


def test_the_choice_is_the_same_each_time_and_may_be_another(video, tmp_path, messages):
    folders = [tmp_path / name for name in "abc"]
    for folder in folders:
        folder.mkdir()
    first, second = (video_keyframes(video, folder, 5, messages) for folder in folders[:2])
    assert [one.path.read_bytes() for one in first] == [one.path.read_bytes() for one in second]
    given = video_keyframes(video, folders[2], 5, messages, frames=["30", "2", "11"])
    assert [one.number for one in given] == [2, 11, 30]


@pytest.mark.parametrize(
    ("given", "what"), [(["1", "2", "400"], "no frame 400"), (["1", "x", "3"], "'x' is no number"), (["3"], "1 frames")]
)
def test_frames_that_are_none(video, tmp_path, messages, given, what):
    with pytest.raises(CaptureError, match=what):
        video_keyframes(video, tmp_path, 5, messages, frames=given)


@pytest.mark.parametrize(("suffix", "turns"), [(".mov", 0), (".mp4", 2), (".mp4", 3), (".avi", 0)])
def test_each_container_and_turn(frames, tmp_path, messages, turns, suffix):
    video = write_video(tmp_path / f"walk{suffix}", frames[:6], turns=turns)
    for one in video_keyframes(video, tmp_path, 3, messages, frames=["0", "3", "5"]):
        assert apart(one.path, frames[one.number]) < 8.0


def test_hevc_as_phones_write_it(frames, tmp_path, messages):
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("no encoder of HEVC is here: pip's bpy has one")
    (tmp_path / "frames").mkdir()
    for index, frame in enumerate(frames[:9]):
        save_image(tmp_path / "frames" / f"{index}.png", np.ascontiguousarray(np.rot90(frame)))
    made = subprocess.run(
        [sys.executable, str(PHONE_VIDEO), str(tmp_path / "frames"), str(tmp_path / "walk.mp4"), "--turns", "1"],
        capture_output=True,
        text=True,
    )
    assert made.returncode == 0, made.stderr
    assert b"hvc1" in (tmp_path / "walk.mp4").read_bytes() or b"hev1" in (tmp_path / "walk.mp4").read_bytes()
    for one in video_keyframes(tmp_path / "walk.mp4", tmp_path, 3, messages, frames=["0", "4", "8"]):
        assert apart(one.path, frames[one.number]) < 8.0


@pytest.mark.parametrize("content", [b"", b"no video", b"#EXTM3U\n#EXTINF:1,\nother.mp4\n", b"ffconcat version 1.0\n"])
def test_what_is_no_video_is_refused_before_anything_decodes_it(tmp_path, messages, content):
    video = tmp_path / "walk.mp4"
    video.write_bytes(content)
    with refused(CaptureError, video, "no video"):
        video_keyframes(video, tmp_path, 5, messages)


def test_a_playlist_leads_to_no_other_file(video, tmp_path):
    """The child looks for itself, too: FFmpeg would open the other file, or an address."""
    (tmp_path / "other.mp4").write_bytes(video.read_bytes())
    for name, content in {
        "list.mp4": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:4,\nother.mp4\n#EXT-X-ENDLIST\n",
        "concat.mp4": "ffconcat version 1.0\nfile other.mp4\n",
    }.items():
        (tmp_path / name).write_text(content)
        request = {"video": str(tmp_path / name), "measures": str(tmp_path / "m.npz"), "told": str(tmp_path / "told")}
        with pytest.raises(CaptureError, match="no video"):
            call_in_child(video_frames.measure_in_child, request)


def test_damaged_videos_end_in_an_error_or_in_what_is_left(video, tmp_path, messages, rng):
    whole = video.read_bytes()
    noise = bytearray(whole)
    for place in rng.integers(100, len(whole), 200):
        noise[place] = rng.integers(256)
    for name, content in {"cut": whole[: len(whole) // 2], "noise": bytes(noise), "head": whole[:40]}.items():
        damaged = tmp_path / f"{name}.mp4"
        damaged.write_bytes(content)
        try:
            assert len(video_keyframes(damaged, tmp_path, 3, messages)) == 3
        except CaptureError as error:
            assert error.where == str(damaged)


def test_it_is_cancelled_at_once(video, tmp_path, messages):
    """As a signal does it: all children are killed, and nobody waits for more frames."""
    ended, is_over = [], threading.Event()

    def cancel() -> None:
        while not is_over.wait(0.3):  # one child may just have ended, and the next not begun
            ended.append(time.monotonic())
            kill_children()

    thread = threading.Thread(target=cancel)
    thread.start()
    try:
        with pytest.raises(CaptureError, match="cannot be read"):
            for _ in range(20):
                video_keyframes(video, tmp_path, 3, messages)
        assert time.monotonic() - ended[0] < 2.0
    finally:
        is_over.set()
        thread.join()


def test_of_many_photographs_as_many_are_taken_as_are_asked_for(frames, tmp_path, messages):
    paths = []
    for index, frame in enumerate(frames):
        paths.append(tmp_path / f"IMG_{index:03d}.png")
        save_image(paths[-1], frame)
    taken = photograph_keyframes(paths, 6, messages)
    numbers = [paths.index(path) for path in taken]
    assert len(taken) == 6 and numbers == sorted(numbers)
    assert not set(numbers) & set(SHAKES)
    assert numbers[0] <= 8 and numbers[-1] >= COUNT - 9
    assert all(path.name in messages.messages[-1][1] for path in taken)
    assert photograph_keyframes(paths, COUNT, messages) == paths
    assert photograph_keyframes(paths, 6, messages, ["IMG_004.png", "IMG_001.png"]) == [paths[1], paths[4]]
    with pytest.raises(CaptureError, match="no photograph 'IMG_4'"):
        photograph_keyframes(paths, 6, messages, ["IMG_4"])


@pytest.mark.parametrize(("time_s", "told"), [(59.994, "0:59.99"), (59.997, "1:00.00"), (125.5, "2:05.50")])
def test_a_minute_has_sixty_seconds(tmp_path, time_s, told):
    assert f"({told})" in str(Keyframe(1, time_s, tmp_path))
