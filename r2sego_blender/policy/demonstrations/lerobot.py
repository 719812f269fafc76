"""Demonstrations as a LeRobot dataset, format v3.0 (huggingface/lerobot at 7427f318, Apache-2.0).

Tables of Arrow and video at a constant rate, written by hand: LeRobot's own package wants an older torch. Many episodes
share a file; ``meta/episodes`` says where each begins.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.atomic_files import remove, rename
from ...core.errors import RobotError
from ...core.json_files import write_json
from ...core.scratch import keeping, scratch_place
from ..packages import policy_package

if TYPE_CHECKING:
    import av
    import pyarrow

HEAD = "observation.images.head"
"""The head camera's feature."""

_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_INDICES = ("frame_index", "episode_index", "index", "task_index")
_CODEC, _PIXELS = "libx264", "yuv420p"
_ENCODING = {"crf": "18", "g": "2"}  # every second picture stands alone: training asks for single ones
_FILES_IN_CHUNK, _DATA_MB, _VIDEO_MB = 1000, 100, 200


@dataclass(frozen=True)
class Demonstration:
    """One episode of T frames: ``images`` (T, H, W, 3) uint8 of the head camera, even sides, and its ``task`` in words.

    ``features`` (T, D) float32 by their names, as ``observation.state`` and ``action``, the same in all episodes.
    """

    task: str
    images: np.ndarray
    features: Mapping[str, np.ndarray]


def write_dataset(
    folder: Path,
    demonstrations: Iterable[Demonstration],
    fps: int,
    robot: str,
    names: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write ``folder``, which appears whole; frames come ``fps`` a second, ``names`` are those of a feature's numbers.

    Raises RobotError: the folder is there, no demonstration, or one that does not fit the first; MachineError
    without the packages of the extra ``policy``.
    """
    if folder.exists():
        raise RobotError("it is there already", where=folder, cure="Choose another folder, or move it away.")
    folder.parent.mkdir(parents=True, exist_ok=True)
    staging = folder.with_name(f".unfinished-{folder.name}")
    remove(staging)
    try:
        with scratch_place(staging):
            with _Writer(staging, fps) as writer:
                for one in demonstrations:
                    writer.add(one)
            if not writer.episodes:
                raise RobotError("there is no demonstration", where=folder, cure="Record some first.")
            writer.write_meta(robot, names or {})
            with keeping(staging):
                rename(staging, folder)
    finally:
        remove(staging)


class _Writer:
    """Adds episodes to data and video files, and begins new ones where they have grown."""

    def __init__(self, root: Path, fps: int) -> None:
        self._av, self._arrow, self._parquet = map(policy_package, ("av", "pyarrow", "pyarrow.parquet"))
        self._root, self._fps = root, fps
        self._file, self._in_file, self._frames = -1, 0, 0
        self._data: Any = None
        self._video: Any = None
        self.episodes: list[dict[str, Any]] = []
        self._tasks: dict[str, int] = {}
        self._stats: list[dict[str, dict[str, np.ndarray]]] = []
        self._shapes: dict[str, tuple[int, ...]] = {}

    def __enter__(self) -> _Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def add(self, one: Demonstration) -> None:
        """Append an episode."""
        count, episode = len(one.images), len(self.episodes)
        shapes = {HEAD: one.images.shape[1:], **{name: values.shape[1:] for name, values in one.features.items()}}
        fits = shapes == (self._shapes or shapes) and all(len(values) == count for values in one.features.values())
        pictures = one.images.dtype == np.uint8 and one.images.ndim == 4 and one.images.shape[3] == 3
        flat = all(values.ndim == 2 and np.isfinite(values).all() for values in one.features.values())
        if not (count and fits and pictures and flat) or one.images.shape[1] % 2 or one.images.shape[2] % 2:
            raise RobotError(
                f"demonstration {episode} does not fit: {shapes} after {self._shapes}",
                where=self._root,
                cure="Give (T, H, W, 3) uint8 of even sides, and (T, D) finite numbers of the same names and sizes.",
            )
        self._shapes = shapes
        if self._data is None or self._is_full():
            self._open()
        task = self._tasks.setdefault(one.task, len(self._tasks))
        columns = {name: np.asarray(values, np.float32) for name, values in one.features.items()}
        columns |= {"timestamp": (np.arange(count) / self._fps).astype(np.float32)}
        columns |= dict(zip(_INDICES, _counted(count, episode, self._frames, task), strict=True))
        self._data.write_table(self._table(columns))
        self._encode(one.images)
        stats = {name: _stats_of(values) for name, values in columns.items()} | {HEAD: _stats_of_images(one.images)}
        chunk, file = divmod(self._file, _FILES_IN_CHUNK)
        row: dict[str, Any] = {"episode_index": episode, "tasks": [one.task], "length": count}
        row |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + count}
        row |= {"data/chunk_index": chunk, "data/file_index": file}
        row |= {f"videos/{HEAD}/chunk_index": chunk, f"videos/{HEAD}/file_index": file}
        row |= {f"videos/{HEAD}/from_timestamp": self._in_file / self._fps}
        row |= {f"videos/{HEAD}/to_timestamp": (self._in_file + count) / self._fps}
        row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        row |= {
            f"stats/{name}/{kind}": value.tolist() for name, kinds in stats.items() for kind, value in kinds.items()
        }
        self.episodes.append(row)
        self._stats.append(stats)
        self._frames += count
        self._in_file += count

    def write_meta(self, robot: str, names: Mapping[str, Sequence[str]]) -> None:
        """Write ``meta/`` of all episodes added."""
        features: dict[str, Any] = {HEAD: self._video_feature()}
        for name, shape in self._shapes.items():
            if name != HEAD:
                features[name] = {"dtype": "float32", "shape": list(shape), "names": list(names.get(name, ())) or None}
        features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
        features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in _INDICES}
        info = {"codebase_version": "v3.0", "robot_type": robot, "total_episodes": len(self.episodes)}
        info |= {"total_frames": self._frames, "total_tasks": len(self._tasks), "chunks_size": _FILES_IN_CHUNK}
        info |= {"data_files_size_in_mb": _DATA_MB, "video_files_size_in_mb": _VIDEO_MB, "fps": self._fps}
        info |= {"splits": {"train": f"0:{len(self.episodes)}"}, "data_path": _DATA, "video_path": _VIDEO}
        (self._root / _EPISODES).parent.mkdir(parents=True)
        write_json(self._root / "meta/info.json", info | {"features": features})
        stats = {name: _merged([one[name] for one in self._stats]) for name in self._stats[0]}
        told = {name: {kind: value.tolist() for kind, value in kinds.items()} for name, kinds in stats.items()}
        write_json(self._root / "meta/stats.json", told)
        self._parquet.write_table(self._arrow.Table.from_pylist(self.episodes), self._root / _EPISODES)
        self._parquet.write_table(self._task_table(), self._root / "meta/tasks.parquet")

    def _video_feature(self) -> dict[str, Any]:
        height, width, channels = self._shapes[HEAD]
        info = {"video.height": height, "video.width": width, "video.codec": "h264", "video.pix_fmt": _PIXELS}
        info |= {"video.is_depth_map": False, "video.fps": self._fps, "video.channels": channels, "has_audio": False}
        names = ["height", "width", "channels"]
        return {"dtype": "video", "shape": [height, width, channels], "names": names, "info": info}

    def _task_table(self) -> pyarrow.Table:
        """The tasks with their words as pandas' index, by which LeRobot finds them."""
        index = "__index_level_0__"
        table = self._arrow.table({"task_index": list(self._tasks.values()), index: list(self._tasks)})
        columns: list[dict[str, Any]] = [
            {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64"},
            {"name": None, "field_name": index, "pandas_type": "unicode", "numpy_type": "object"},
        ]
        pandas = {
            "index_columns": [index],
            "column_indexes": [{"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object",
                                "metadata": {"encoding": "UTF-8"}}],
            "columns": [one | {"metadata": None} for one in columns],
            "creator": {"library": "pyarrow", "version": self._arrow.__version__},
            "pandas_version": "2.2.3",
        }  # fmt: skip
        return table.replace_schema_metadata({"pandas": json.dumps(pandas)})

    def _table(self, columns: Mapping[str, np.ndarray]) -> pyarrow.Table:
        """Rows of vectors as lists of a fixed length, of single numbers as they are."""
        arrow = self._arrow
        arrays = {}
        for name, values in columns.items():
            flat = arrow.array(np.ascontiguousarray(values).reshape(-1))
            is_vector = values.ndim == 2 and values.shape[1] > 1
            arrays[name] = arrow.FixedSizeListArray.from_arrays(flat, values.shape[1]) if is_vector else flat
        return arrow.table(arrays)

    def _is_full(self) -> bool:
        data, video = self._places()
        return data.stat().st_size > _DATA_MB << 20 or video.stat().st_size > _VIDEO_MB << 20

    def _places(self) -> tuple[Path, Path]:
        chunk, file = divmod(self._file, _FILES_IN_CHUNK)
        named = {"chunk_index": chunk, "file_index": file, "video_key": HEAD}
        return self._root / _DATA.format(**named), self._root / _VIDEO.format(**named)

    def _open(self) -> None:
        self._close()
        self._file, self._in_file = self._file + 1, 0
        for place in self._places():
            place.parent.mkdir(parents=True, exist_ok=True)
        data, video = self._places()
        columns = {name: np.zeros((0, *shape), np.float32) for name, shape in self._shapes.items() if name != HEAD}
        columns |= {"timestamp": np.zeros(0, np.float32)} | dict.fromkeys(_INDICES, np.zeros(0, np.int64))
        self._data = self._parquet.ParquetWriter(data, self._table(columns).schema)
        self._video = self._av.open(str(video), mode="w")
        height, width, _ = self._shapes[HEAD]
        stream = self._video.add_stream(_CODEC, rate=self._fps, options=_ENCODING)
        stream.width, stream.height, stream.pix_fmt = width, height, _PIXELS
        stream.codec_context.time_base = Fraction(1, self._fps)
        self._stream: av.VideoStream = stream

    def _encode(self, images: np.ndarray) -> None:
        for index, image in enumerate(images):
            frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame.pts, frame.time_base = self._in_file + index, Fraction(1, self._fps)
            self._video.mux(self._stream.encode(frame))

    def _close(self) -> None:
        if self._video is not None:
            self._video.mux(self._stream.encode(None))
            self._video.close()
        if self._data is not None:
            self._data.close()
        self._data = self._video = None


def _counted(count: int, episode: int, first: int, task: int) -> tuple[np.ndarray, ...]:
    """The columns ``_INDICES`` of an episode."""
    frames = np.arange(count, dtype=np.int64)
    return frames, np.full(count, episode, np.int64), first + frames, np.full(count, task, np.int64)


def _stats_of(values: np.ndarray) -> dict[str, np.ndarray]:
    """Of (T,) or (T, D), each number for itself."""
    values = values.reshape(len(values), -1).astype(np.float64)
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    return found | {"count": np.array([len(values)])}


def _stats_of_images(images: np.ndarray) -> dict[str, np.ndarray]:
    """Of each channel from 0 to 1, (3, 1, 1); the count is of pictures."""
    found = _stats_of(images.reshape(-1, 3) / 255.0)
    shaped = {kind: value.reshape(3, 1, 1) for kind, value in found.items() if kind != "count"}
    return shaped | {"count": np.array([len(images)])}


def _merged(stats: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Those of all episodes together, weighted by their counts."""
    counts = np.array([one["count"][0] for one in stats], np.float64)
    weights = counts / counts.sum()
    means, stds = np.array([one["mean"] for one in stats]), np.array([one["std"] for one in stats])
    mean = np.tensordot(weights, means, 1)
    return {
        "min": np.min([one["min"] for one in stats], axis=0),
        "max": np.max([one["max"] for one in stats], axis=0),
        "mean": mean,
        "std": np.sqrt(np.tensordot(weights, stds**2 + (means - mean) ** 2, 1)),
        "count": np.array([int(counts.sum())]),
    }
