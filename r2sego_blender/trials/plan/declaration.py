"""What a person declares of a study, in TOML: policies, chairs, ranges of poses, rules (docs/trials.md)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...config.declared_files import Reader
from ...config.fields import Range, setting
from ...core.digests import content_digest
from ...core.errors import TrialError
from .rules import Rules
from .trial_plan import MOST_TRIALS, ORDERS, TETHERS, corners_of, name_text, names_of, sha256_text


def _sha256(value: Any, where: Path) -> str:
    return sha256_text(value, where) if value else ""


@dataclass(frozen=True)
class Policy:
    """A trained policy: its file, beside the declaration, or its SHA-256 where the file lies elsewhere."""

    condition: str = setting(doc="The visual asset it was trained with.", read=name_text)
    seed: int = setting(doc="Its policy-training seed; the same in each condition makes a pair.", low=0, high=2**31)
    file: str = setting("", "Its file.")
    sha256: str = setting("", "Its file's SHA-256.", read=_sha256)
    simulated_successes: int | None = setting(
        None, "Successes in its training simulator, fixed beforehand.", 0, 1_000_000
    )
    simulated_episodes: int = setting(25, "Of so many episodes.", 1, 1_000_000)

    def digest(self, beside: Path) -> str:
        """The SHA-256 of its file, which lies ``beside``. Raises TrialError."""
        named = f"policy of {self.condition}, seed {self.seed}"
        if not self.file and not self.sha256:
            raise TrialError(f"the {named} has neither file nor sha256", where=beside, cure="Give one of them.")
        if "\0" in self.file:
            raise TrialError(f"the {named} has a name that no file has", where=beside, cure="Name a file.")
        try:
            if self.file and (beside / self.file).is_dir():  # which may be a whole disk
                cure = "Name the policy's own file."
                raise TrialError(f"the {named} is a folder", where=beside / self.file, cure=cure)
            found = content_digest(beside / self.file) if self.file else self.sha256
        except OSError as error:
            raise TrialError(
                f"the {named} cannot be read: {error.strerror}", where=beside / self.file, cure="Allow reading it."
            ) from error
        if not found:
            raise TrialError(f"the {named} is not there", where=beside / self.file, cure="Name a file that is.")
        if self.sha256 not in ("", found):
            cure = f"Its SHA-256 is {found}: name the file that was trained, or correct sha256."
            raise TrialError(f"the {named} has another content", where=beside / self.file, cure=cure)
        return found


@dataclass(frozen=True)
class ChairPoses:
    """Where the chair stands, in the world; it faces where its sitter looks."""

    x_m: Range = setting((0.0, 0.0), "Its seat's middle.", -1000.0, 1000.0)
    y_m: Range = setting((0.0, 0.0), "Its seat's middle.", -1000.0, 1000.0)
    heading_deg: Range = setting((0.0, 0.0), "The way it faces, counter-clockwise from the x axis.", -180.0, 180.0)


@dataclass(frozen=True)
class RobotPoses:
    """Where the robot starts, seen from the chair."""

    distance_m: Range = setting((1.0, 1.5), "From the seat's middle.", 0.0, 100.0)
    bearing_deg: Range = setting((-20.0, 20.0), "From the way the chair faces, counter-clockwise.", -180.0, 180.0)
    facing_deg: Range = setting((-15.0, 15.0), "From looking at the chair, counter-clockwise.", -180.0, 180.0)


@dataclass(frozen=True)
class Declaration:
    """A declared study; poses and chairs are drawn alike for all policies of a pair."""

    name: str = setting(doc="The study's name.", read=name_text)
    policies: tuple[Policy, ...] = setting(doc="The trained policies.")
    trials: int = setting(8, "Trials of each policy.", 1, 1000)
    order: str = setting(
        "alternating",
        "Conditions always in one order, the paper's, or in one drawn for each seed and repetition.",
        choices=ORDERS,
    )
    blinded: bool = setting(False, "The operator reads a drawn label, and no counts until the end.")
    tether: str = setting(
        "gate", "Detached after a policy's first successful tethered trial, or never.", choices=TETHERS
    )
    seed: int = setting(0, "What orders, labels, poses and chairs are drawn from.", 0, 2**31)
    floor: tuple[tuple[float, float], ...] = setting((), "Outline of the floor, for the page.", read=corners_of)
    chairs: tuple[str, ...] = setting(("chair",), "Types of chairs, taken in turns.", read=names_of)
    chair: ChairPoses = setting(ChairPoses())
    robot: RobotPoses = setting(RobotPoses())
    rules: Rules = setting(Rules())

    @staticmethod
    def load(file: str | Path) -> Declaration:
        """Read a declaration. Raises TrialError naming the file and the field."""
        reader = Reader(Path(file), "declaration of trials", TrialError)
        try:
            declared = reader.table(Declaration, reader.tables("See docs/trials.md."))
        except OSError as error:
            raise TrialError(
                "this declaration of trials cannot be read", where=file, cure="Give a TOML file, as docs/trials.md."
            ) from error
        pairs = [(policy.condition, policy.seed) for policy in declared.policies]
        if len(set(pairs)) < len(pairs):
            raise reader.wrong("policies", "has a condition and seed twice", "Give each policy once.")
        conditions, seeds = dict.fromkeys(one for one, _ in pairs), dict.fromkeys(two for _, two in pairs)
        if len(pairs) != len(conditions) * len(seeds):
            raise reader.wrong("policies", "are no pairs", "Give each condition the same seeds.")
        if not 0 < len(pairs) * declared.trials <= MOST_TRIALS:
            raise reader.wrong("policies", "make no plan", f"Plan 1 to {MOST_TRIALS} trials.")
        if declared.blinded and declared.order == "alternating":
            cure = 'Write order = "randomised": a fixed order tells the condition.'
            raise reader.wrong("blinded", "is true in an alternating order", cure)
        if any((one.simulated_successes or 0) > one.simulated_episodes for one in declared.policies):
            raise reader.wrong("policies", "succeeded more often than tried", "Correct simulated_successes.")
        return declared
