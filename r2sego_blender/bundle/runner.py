"""The runner: makes what steps of Algorithm 1 publish, and passes over what is there already.

A step is what it makes, what it takes, and its settings; its key is the digest of these. It runs again
only when the key changed or its result was damaged. Results are written beside their place, flushed
and renamed, so a cut-off run leaves the bundle as it was.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.digests import content_digest
from .artifacts import Artifact, Held
from .damage import is_damaged
from .disk import disk_errors
from .frames import frame_of_output
from .keys import step_key
from .scene import Scene
from .stale import of_old_frame


@dataclass(frozen=True)
class Step:
    """A step by names.

    ``target`` is a path inside the bundle, a file when it has a suffix, else a folder; ``compute``
    writes it at the path it is given. ``inputs`` are files and folders, inside the bundle when
    relative; ``parameters`` are dataclasses or JSON values. ``read`` reads the result as later steps
    do: one that is not as it was published is kept as a person's edit where that succeeds. Without it
    any change is damage. ``seconds`` are what it took where it was computed before, beside others.
    """

    target: str
    compute: Callable[[Path], object]
    inputs: Sequence[str] = ()
    parameters: Any = None
    read: Callable[[], object] | None = None
    seconds: float = 0.0


class Runner:
    """Runs steps on a scene. Another strategy, as ``Plan``, does something else in ``do``; ``makes`` is whether what
    steps publish is there afterwards."""

    makes = True

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def held(self) -> contextlib.AbstractContextManager[None]:
        """What has to be held while steps run: the bundle's lock."""
        return self.scene.locked()

    def make(
        self,
        made: Artifact[Held],
        compute: Callable[..., Any],
        *takes: Artifact[Any],
        settings: Any = None,
        fits: Callable[..., object] | None = None,
        also: Sequence[str] = (),
        seconds: float = 0.0,
    ) -> Artifact[Held]:
        """See that ``made`` is there: what ``compute`` returns, called with all that is taken, loaded.

        An artifact without a writer is written by ``compute``, which is given the place first.
        ``settings`` are all that it depends on besides. ``fits`` raises where an edited result does not
        belong to what it was made of: it is called as ``fits(result, *taken)``. ``also`` names what the
        key holds although nothing is read of it. ``seconds`` are what ``compute`` returns at once took before.
        """

        def write(place: Path) -> None:
            taken = [self.scene.read(one) for one in takes]
            if made.save is None:
                compute(place, *taken)
            else:
                made.save(compute(*taken), place)

        def read() -> None:
            if fits is None:
                (made.check or made.load)(self.scene.path / made.name)
            else:
                fits(self.scene.read(made), *(self.scene.read(one) for one in takes))

        inputs = [*dict.fromkeys([*(one.key for one in takes), *also])]
        read_edited = read if made.editable else None
        self.step(made.name, write, inputs=inputs, parameters=settings, read=read_edited, seconds=seconds)
        return made

    def step(self, target: str, compute: Callable[[Path], object], **known: Any) -> Path:
        """``do`` a ``Step``; its place."""
        self.do(Step(target, compute, **known))
        return self.scene.path / target

    def do(self, step: Step) -> None:
        """Make the target unless it is there and nothing that the step reads has changed."""
        scene, target, place = self.scene, step.target, self.scene.path / step.target
        key = self.key(step.inputs, step.parameters)
        before = scene.recorded().get(target)
        if place.exists() and before == key and not is_damaged(scene, target, step.read):
            return
        started, started_s = time.time(), time.monotonic()
        with disk_errors(place), scene.publishing(target) as staging:
            step.compute(staging)
            if before is not None:
                # Killed from here on, the old record is no longer true.
                scene.note(publishing=target)
        record = {
            "step": target,
            "inputs": key,
            "output": content_digest(place),
            "started": round(started, 3),
            "seconds": round(time.monotonic() - started_s + step.seconds, 3),
            "frame": frame_of_output(scene.declaration.world_from_capture, step.inputs, scene.journal()),
        }
        with disk_errors(scene.path):
            scene.note(**record)

    def key(self, inputs: Sequence[str], parameters: Any) -> str:
        """The key of a step on this scene as it is now."""
        return step_key(inputs, parameters, self._digest_of)

    def _digest_of(self, name: str) -> str:
        return content_digest(self.scene.path / name)


@dataclass(frozen=True)
class PlannedStep:
    """A step of the bundle: ``target``, and why it is redone; '' where it is kept."""

    target: str
    why: str


class Plan(Runner):
    """Looks at the steps only: nothing is run and nothing is written. ``steps`` holds what it saw.

    A step whose input is redone counts as redone; should the input come out the same, it is kept.
    """

    makes = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.steps: list[PlannedStep] = []
        self._digests: dict[str, str] = {}
        self._of_old_frame = set(of_old_frame(scene))
        self._last = scene.recorded()

    def held(self) -> contextlib.AbstractContextManager[None]:
        """Nothing: nothing is written."""
        return contextlib.nullcontext()

    def do(self, step: Step) -> None:
        """Note whether ``Runner.do`` would make the target, if what the step reads is as it seems."""
        redone = {planned.target for planned in self.steps if planned.why}
        first = next((name for name in step.inputs if name in redone), None)
        if not (self.scene.path / step.target).exists():
            why = "it is not there yet"
        elif first is not None:
            why = f"{first} is redone"
        elif self._last.get(step.target) != self.key(step.inputs, step.parameters):
            corrected = step.target in self._of_old_frame
            why = "the world frame was corrected" if corrected else "what it reads or a setting has changed"
        else:
            why = "it is damaged" if is_damaged(self.scene, step.target, step.read) else ""
        self.steps.append(PlannedStep(step.target, why))

    def _digest_of(self, name: str) -> str:
        if name not in self._digests:
            self._digests[name] = super()._digest_of(name)
        return self._digests[name]
