"""Workers whose responses are kept in a folder: given again without the worker, and recorded of one."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

from ...core.errors import NativeError
from ...core.json_files import read_json
from .asking import Tell, Worker
from .response import Limits, content_size
from .serving import REQUEST_FILE, plain_path


class RecordedWorker:
    """Answers from ``folder``: with the response in the folder called by the request's key, else by its task."""

    def __init__(self, folder: Path) -> None:
        """``folder`` as a ``RecordingWorker`` writes it, or by hand."""
        self.name, self.cure = str(folder), "Record it again."
        self._folder = folder

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """See ``asking.Worker``. Raises NativeError where there is no such response."""
        task = plain_path(read_json(request / REQUEST_FILE)["task"])
        found = next(
            (self._folder / name for name in (request_key(request), task) if (self._folder / name).is_dir()), None
        )
        if found is None:
            raise NativeError(
                f"no response to this request of the task {task} is recorded", where=self.name, cure=self.cure
            )
        has, files = content_size(found)
        if has > limits.answer_bytes or files > limits.files:
            raise NativeError(f"what is recorded has {has} bytes in {files} files", where=found, cure=self.cure)
        shutil.copytree(found, response, symlinks=True, dirs_exist_ok=True)  # links are refused by who reads it

    def close(self) -> None:
        """Nothing runs."""


class RecordingWorker:
    """Another worker, whose responses are kept in ``folder`` by their requests' keys."""

    def __init__(self, worker: Worker, folder: Path) -> None:
        """``folder`` may be there."""
        self.name, self.cure = worker.name, worker.cure
        self._worker, self._folder = worker, folder

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """See ``asking.Worker``."""
        key = request_key(request)
        self._worker.answer(request, response, tell, limits)
        shutil.copytree(response, self._folder / key, symlinks=True, dirs_exist_ok=True)

    def close(self) -> None:
        """See ``asking.Worker``."""
        self._worker.close()


def request_key(request: Path) -> str:
    """The name of a request's recorded response: of its task, backend, parameters and what its inputs hold."""
    return hashlib.sha256((request / REQUEST_FILE).read_bytes()).hexdigest()[:16]
