"""A written dataset says what LeRobot's format v3.0 says, and gives its frames and numbers back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from expected_errors import refused

from r2sego_blender.core.errors import RobotError
from r2sego_blender.policy.demonstrations import lerobot
from r2sego_blender.policy.demonstrations.lerobot import HEAD, Demonstration, write_dataset

av = pytest.importorskip("av", reason="make install POLICY=1")
parquet = pytest.importorskip("pyarrow.parquet", reason="make install POLICY=1")

FPS, SHAPE = 10, (48, 64)
LENGTHS, TASKS = (7, 12, 5), ("sit down", "walk", "sit down")


def demonstrations() -> list[Demonstration]:
    rng = np.random.default_rng(5)
    found = []
    for episode, (length, task) in enumerate(zip(LENGTHS, TASKS, strict=True)):
        ramp = np.linspace(0, 200, SHAPE[1])[None, :, None] + np.zeros((*SHAPE, 3))
        images = np.array([ramp + 4 * frame + 10 * episode for frame in range(length)]).clip(0, 255).astype(np.uint8)
        features = {"observation.state": rng.normal(size=(length, 5)), "action": rng.uniform(-1, 1, (length, 4))}
        features |= {"assist": rng.uniform(size=(length, 1))}
        found.append(Demonstration(task, images, {name: one.astype(np.float32) for name, one in features.items()}))
    return found


@pytest.fixture(scope="module", params=[200, 0], ids=["one file", "a file each"])
def written(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("demonstrations") / "room"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lerobot, "_VIDEO_MB", request.param)
        names = {"action": ["vx", "vy", "yaw_rate", "sit"]}
        write_dataset(folder, iter(demonstrations()), FPS, "unitree_g1", names)
    return folder, json.loads((folder / "meta/info.json").read_text())


def rows(folder) -> list[dict]:
    return parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()


def test_info_is_of_the_format(written):
    folder, info = written
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", FPS, "unitree_g1")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, sum(LENGTHS), 2)
    assert info["splits"] == {"train": "0:3"} and info["chunks_size"] == 1000
    assert info["data_path"] == "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    assert info["video_path"] == "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    features = info["features"]
    assert features[HEAD]["dtype"] == "video" and features[HEAD]["shape"] == [*SHAPE, 3]
    assert features["action"] == {"dtype": "float32", "shape": [4], "names": ["vx", "vy", "yaw_rate", "sit"]}
    assert features["timestamp"]["dtype"] == "float32"
    for name in ("frame_index", "episode_index", "index", "task_index"):
        assert features[name] == {"dtype": "int64", "shape": [1], "names": None}
    assert not list(folder.parent.glob(".unfinished*"))


def test_tasks_are_found_by_pandas_index(written):
    table = parquet.read_table(written[0] / "meta/tasks.parquet")
    assert table.to_pydict() == {"task_index": [0, 1], "__index_level_0__": ["sit down", "walk"]}
    told = json.loads(table.schema.metadata[b"pandas"])
    assert told["index_columns"] == ["__index_level_0__"]
    assert [one["field_name"] for one in told["columns"]] == ["task_index", "__index_level_0__"]


def test_every_episode_gives_its_numbers_and_pictures_back(written):
    folder, info = written
    first = 0
    for episode, (row, one) in enumerate(zip(rows(folder), demonstrations(), strict=True)):
        length = len(one.images)
        assert (row["episode_index"], row["length"], row["tasks"]) == (episode, length, [one.task])
        assert (row["dataset_from_index"], row["dataset_to_index"]) == (first, first + length)
        place = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
        table = parquet.read_table(folder / info["data_path"].format(**place))
        table = table.filter(np.array(table["episode_index"]) == episode)
        assert np.array(table["index"]).tolist() == list(range(first, first + length))
        assert np.array(table["frame_index"]).tolist() == list(range(length))
        assert set(np.array(table["task_index"])) == {TASKS.index(one.task)}
        assert np.allclose(np.array(table["timestamp"]), np.arange(length) / FPS, atol=1e-6)
        assert str(table.schema.field("timestamp").type) == "float"
        for name, values in one.features.items():
            assert np.array_equal(np.array(table[name].to_pylist(), np.float32).reshape(values.shape), values)
        assert table.schema.field("action").type.list_size == 4 and str(table.schema.field("assist").type) == "float"
        place = {part: row[f"videos/{HEAD}/{part}"] for part in ("chunk_index", "file_index")}
        with av.open(str(folder / info["video_path"].format(video_key=HEAD, **place))) as video:
            assert video.streams.video[0].average_rate == FPS
            frames = {
                round(float(frame.time) * FPS, 6): frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)
            }
        begins = row[f"videos/{HEAD}/from_timestamp"] * FPS
        assert row[f"videos/{HEAD}/to_timestamp"] * FPS == pytest.approx(begins + length)
        for index, image in enumerate(one.images):
            seen = frames[round(begins + index, 6)]  # constant rate: each at its own time exactly
            assert np.abs(seen.astype(float) - image).mean() < 3.0
        first += length


def test_statistics_are_those_of_all_frames(written):
    folder, _ = written
    told = json.loads((folder / "meta/stats.json").read_text())
    for name in ("observation.state", "action", "assist"):
        every = np.concatenate([one.features[name] for one in demonstrations()]).astype(np.float64)
        expected = {"min": every.min(0), "max": every.max(0), "mean": every.mean(0), "std": every.std(0)}
        assert all(np.allclose(told[name][kind], value) for kind, value in expected.items())
        assert told[name]["count"] == [sum(LENGTHS)]
    pixels = np.concatenate([one.images.reshape(-1, 3) for one in demonstrations()]) / 255.0
    assert np.allclose(np.ravel(told[HEAD]["mean"]), pixels.mean(0)) and np.shape(told[HEAD]["std"]) == (3, 1, 1)
    assert np.allclose(np.ravel(told[HEAD]["std"]), pixels.std(0))
    assert all(np.allclose(row["stats/action/mean"], one.features["action"].mean(0), atol=1e-6)
               for row, one in zip(rows(folder), demonstrations(), strict=True))  # fmt: skip


def test_a_folder_that_is_there_is_left_alone(tmp_path):
    with refused(RobotError, tmp_path):
        write_dataset(tmp_path, demonstrations(), FPS, "g1")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["none", "size", "names", "odd", "infinite"])
def test_what_does_not_fit_leaves_nothing(tmp_path, wrong):
    one, other = demonstrations()[:2]
    features = dict(other.features)
    if wrong == "size":
        features["action"] = features["action"][:, :3]
    elif wrong == "names":
        features["torque"] = features.pop("action")
    elif wrong == "infinite":
        features["action"] = features["action"] * np.inf
    images = other.images[:, :47] if wrong == "odd" else other.images
    given = [] if wrong == "none" else [one, Demonstration("walk", images, features)]
    with refused(RobotError, "room"), np.errstate(invalid="ignore"):
        write_dataset(tmp_path / "room", given, FPS, "g1")
    assert not list(tmp_path.iterdir())
