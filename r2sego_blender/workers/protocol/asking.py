"""Asking a worker, whichever kind it is: a program, one on this machine's loopback, or a recorded one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from ...core.printable import printable
from ...core.progress import SILENT, Progress, Task
from ...core.scratch import ScratchFolder
from .request import Request, write_request
from .response import Limits, RefusedRequestError, Response, read_response

Tell = Callable[[Mapping[str, Any]], None]
"""Is given each line of progress {done, total, text}, as a worker wrote it."""

_LONGEST_TITLE = 60
_MOST_TOTAL = 1 << 31


class Worker(Protocol):
    """Who answers. ``name`` is where errors are, ``cure`` what they advise."""

    name: str
    cure: str

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """Have the request in one folder answered in another, which is empty, whatever it holds in the end.

        Raises MachineError where the worker is not there, NativeError where it died, hung, or wrote too much.
        """
        ...

    def close(self) -> None:
        """End what runs; the next request starts it again."""
        ...


@contextlib.contextmanager
def ask(
    worker: Worker,
    request: Request,
    progress: Progress = SILENT,
    limits: Limits = Limits(),
    *,
    allow_random: bool = False,
    folder: Path | None = None,
) -> Iterator[Response]:
    """The worker's response; its files are gone with the ``with`` block, unless they lie in ``folder``, "response".

    ``folder`` is an empty one, or has inputs of the request in "request". An answer of random weights is refused
    unless ``allow_random``, which is for tests alone. Raises as ``Worker.answer`` and ``read_response`` do:
    NativeError costs this request only, MachineError says that others fare no better. A worker that broke, or
    whose answer an error leaves the block for, is ended.
    """
    with contextlib.ExitStack() as stack:
        place = Path(stack.enter_context(ScratchFolder())) if folder is None else folder
        asked, answered = (Path(place, name).resolve() for name in ("request", "response"))
        for one in (asked, answered):
            one.mkdir(exist_ok=True)
        write_request(request, asked)
        try:
            with _Shown(progress, request.task) as shown:
                worker.answer(asked, answered, shown.tell, limits)
            yield read_response(answered, request.task, worker.name, worker.cure, limits, allow_random=allow_random)
        except RefusedRequestError:
            raise
        except BaseException:
            worker.close()  # what it would still do must not disturb the next request
            raise


class _Shown:
    """A worker's lines as tasks of a progress."""

    def __init__(self, progress: Progress, title: str) -> None:
        self._progress, self._title = progress, title
        self._stack = contextlib.ExitStack()
        self._task: Task | None = None

    def __enter__(self) -> _Shown:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def tell(self, line: Mapping[str, Any]) -> None:
        """Show a line; one that is none is passed over."""
        try:
            done, total = int(line["done"]), int(line["total"])
            title = printable(str(line.get("text") or self._title), _LONGEST_TITLE)
        except (LookupError, TypeError, ValueError, OverflowError):
            return
        if not 0 <= done <= total <= _MOST_TOTAL:
            return
        task = self._task
        if task is None or (task.title, task.total) != (title, total):
            self._stack.close()
            task = self._task = self._stack.enter_context(self._progress.task(title, total))
        if done > task.done:
            task.advance(done - task.done)
