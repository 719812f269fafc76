"""Colours of videos, as phones state them: BT.709, and HDR."""

from __future__ import annotations

import numpy as np
import pytest
from phone_videos import filmed, state_colours, write_video

from r2sego_blender.captures.keyframes.choosing import video_keyframes
from r2sego_blender.captures.keyframes.video_colours import VideoColours, colours_of
from r2sego_blender.core.colours import linear_from_srgb, srgb_from_linear
from r2sego_blender.core.images import load_image_uint8

LUMA = {1: (0.2126, 0.7152, 0.0722), 6: (0.299, 0.587, 0.114), 9: (0.2627, 0.6780, 0.0593)}


def as_decoded(colours, matrix):
    """What BT.601's matrix makes of colours (..., 3) that were encoded by another: by luma and colour differences."""
    red, green, blue = LUMA[matrix]
    luma = colours @ [red, green, blue]
    cb, cr = (colours[..., 2] - luma) / (2 - 2 * blue), (colours[..., 0] - luma) / (2 - 2 * red)
    # BT.601, 2.5.3
    return np.stack([luma + 1.402 * cr, luma - 0.344136 * cb - 0.714136 * cr, luma + 1.772 * cb], axis=-1)


@pytest.mark.parametrize("matrix", [1, 9])
def test_colours_of_another_matrix_are_those_that_were_encoded(rng, matrix):
    colours = rng.random((40, 50, 3))
    decoded = as_decoded(colours, matrix)
    whole = ((decoded >= 0.0) & (decoded <= 1.0)).all(axis=2)  # what left the range is lost
    levels = np.round(255.0 * np.clip(decoded, 0.0, 1.0)).astype(np.uint8)
    found = VideoColours(1, 1, matrix).to_srgb(levels)
    assert whole.mean() > 0.7 and np.abs(found - 255.0 * colours)[whole].max() < 2.5
    assert np.abs(levels - 255.0 * colours)[whole].max() > 15.0


@pytest.mark.parametrize("colours", [VideoColours(), VideoColours(1, 1, 6), VideoColours(6, 6, 6)])
def test_colours_that_are_right_stay_as_they_are(rng, colours):
    levels = rng.integers(0, 256, (8, 9, 3)).astype(np.uint8)
    assert np.array_equal(colours.to_srgb(levels), levels)


# BT.2408, table 1: how bright a grey card (18 %) and diffuse white are in cd/m^2, and their signal.
@pytest.mark.parametrize(("transfer", "grey", "white"), [(18, 0.38, 0.75), (16, 0.38, 0.58)])
def test_hdr_has_the_levels_of_its_recommendation(transfer, grey, white):
    signal = np.full((1, 3, 3), 0.0)
    signal[0, 1], signal[0, 2] = grey, white
    found = VideoColours(9, transfer, 9).to_srgb(np.round(255.0 * signal).astype(np.uint8)).astype(float)[0]
    assert (found.max(axis=1) - found.min(axis=1)).max() <= 1.0  # grey stays grey
    assert found[0].max() == 0.0
    assert found[1, 0] == pytest.approx(255.0 * srgb_from_linear(26.0 / 203.0), abs=3.0)
    assert 240.0 < found[2, 0] < 255.0


@pytest.mark.parametrize("transfer", [16, 18])
def test_what_is_brighter_is_never_darker(transfer):
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    found = VideoColours(9, transfer, 9).to_srgb(ramp)[0, :, 0].astype(int)
    assert (np.diff(found) >= 0).all() and found[-1] == 255


def test_p3_is_brought_to_srgb():
    """P3's primaries in BT.709 (SMPTE EG 432-1): its red is beyond, a colour within comes back."""
    within = np.array([[[0.5, 0.3, 0.2]]])
    p3_from_709 = np.array([[0.8225, 0.1774, 0.0], [0.0332, 0.9669, 0.0], [0.0171, 0.0724, 0.9108]])
    levels = np.round(255.0 * srgb_from_linear(linear_from_srgb(within) @ p3_from_709.T)).astype(np.uint8)
    found = VideoColours(12, 1, 2).to_srgb(levels)
    assert np.abs(found - 255.0 * within).max() < 2.0


def test_a_phones_video_comes_with_the_colours_that_were_filmed(tmp_path, room, messages):
    frames = [frame * np.array([1.0, 0.55, 0.35]) for frame in filmed(room.image, 4)]
    as_bt709 = [255.0 * as_decoded(frame / 255.0, 1) for frame in frames]
    pictures = []
    for name, written in (("bt601", frames), ("unstated", as_bt709), ("bt709", as_bt709)):
        (tmp_path / name).mkdir()
        video = write_video(
            tmp_path / f"{name}.mp4", [np.clip(np.round(one), 0, 255).astype(np.uint8) for one in written]
        )
        if name == "bt709":
            state_colours(video, 1, 1, 1)
        taken = video_keyframes(video, tmp_path / name, 3, messages, frames=["0", "2", "3"])
        pictures.append(np.array([load_image_uint8(one.path).astype(float) for one in taken]))
    right, unstated, stated = pictures
    assert np.abs((stated - right).mean(axis=(0, 1, 2))).max() < 1.0
    assert np.abs((unstated - right).mean(axis=(0, 1, 2))).max() > 4.0


def test_hdr_is_told(tmp_path, room, messages):
    video = state_colours(write_video(tmp_path / "walk.mp4", filmed(room.image, 4)), 9, 18, 9)
    video_keyframes(video, tmp_path, 3, messages, frames=["0", "1", "2"])
    assert any("HLG" in text for _, text in messages.messages)


def test_a_file_that_states_none_is_of_unspecified_colours(tmp_path, room):
    video = write_video(tmp_path / "walk.mp4", filmed(room.image, 3))
    assert colours_of(video) == VideoColours()
    whole = state_colours(video, 9, 16, 9).read_bytes()
    assert colours_of(video) == VideoColours(9, 16, 9)
    moov = whole.index(b"moov")
    for cut in range(moov, len(whole), 7):
        video.write_bytes(whole[:cut])
        assert colours_of(video) == VideoColours()
    assert colours_of(tmp_path / "none.mp4") == VideoColours()


def test_real_hdr_of_an_encoder(tmp_path, messages):
    av = pytest.importorskip("av", reason="PyAV, which writes HDR, comes with POLICY=1")
    height, width = 96, 128
    grey = np.linspace(0.0, 0.75, width)[None].repeat(height, axis=0)  # up to diffuse white
    container = av.open(str(tmp_path / "walk.mov"), "w")
    stream = container.add_stream("libx265", rate=30, options={"x265-params": "log-level=none:crf=2"})
    stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p10le"
    context = stream.codec_context
    context.color_primaries, context.color_trc, context.colorspace, context.color_range = 9, 18, 9, 1
    planes = [np.round(4.0 * (16.0 + 219.0 * grey)), *(np.full((height // 2, width // 2), 512.0) for _ in range(2))]
    for number in range(3):
        frame = av.VideoFrame(width, height, "yuv420p10le")
        for plane, values in zip(frame.planes, planes, strict=True):
            rows = np.zeros((plane.height, plane.line_size // 2), np.uint16)
            rows[:, : plane.width] = values
            plane.update(rows.tobytes())
        frame.pts = number
        container.mux(stream.encode(frame))
    container.mux(stream.encode())
    container.close()
    assert colours_of(tmp_path / "walk.mov") == VideoColours(9, 18, 9)
    taken = video_keyframes(tmp_path / "walk.mov", tmp_path, 3, messages, frames=["0", "1", "2"])
    found = load_image_uint8(taken[1].path).astype(float)
    signal = np.round(255.0 * grey[:, :, None].repeat(3, axis=2)).astype(np.uint8)
    apart = np.abs(found - VideoColours(9, 18, 9).to_srgb(signal))
    assert apart.mean() < 1.5 and apart.max() < 10.0
