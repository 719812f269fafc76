"""Policies that are programs: what a person trusts on this machine, and what they could do there."""

from __future__ import annotations

from pathlib import Path

from ...config.trusted_programs import Program
from ...core.errors import RobotError
from .policy_networks import ONNX
from .policy_runtime import content_of, is_program, read_policy
from .policy_worker import PolicyFailedError, PolicyWorker


def program_at(path: Path) -> Program:
    """The program that a policy's file is. Raises RobotError: unreadable, or data, which needs no trust."""
    if not is_program(path):
        raise RobotError(
            f"'{path.suffix}' is no program", where=path, cure="Trust TorchScript files (.pt); ONNX runs without it."
        )
    return Program.of(path.name, content_of(path))


def require_trusted(path: str) -> None:
    """Refuse a policy that is a program nobody has trusted; one that is not there is refused later.

    Raises RobotError.
    """
    if path and is_program(path) and Path(path).is_file():
        read_policy(path)


def kept_rights() -> tuple[str, ...]:
    """What this system cannot take away from a policy's process, in words.

    Raises RobotError where no such process begins.
    """
    try:
        return PolicyWorker(ONNX, b"", 0, "").not_taken
    except PolicyFailedError as error:
        raise RobotError(f"no process begins here: {error}", cure="`r2sego doctor` says what is missing.") from error
