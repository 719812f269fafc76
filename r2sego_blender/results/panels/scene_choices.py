"""What the room Scene offers: robots and behaviour scopes by name, and what Refine does next."""

from __future__ import annotations

from pathlib import Path

_SCOPES = Path(__file__).parents[2] / "robot" / "scopes"


def robot_choices() -> list[str]:
    """The embedded robots; any MJCF or URDF file is one too."""
    return ["embedded:humanoid", "embedded:wheeled"]


def scope_choices() -> list[str]:
    """The shipped behaviour scopes; any TOML file is one too."""
    return sorted(file.stem for file in _SCOPES.glob("*.toml"))


def what_refine_does(rounds_begun: int, rounds_done: int, rounds: int) -> str:
    """What Refine would do next, in words."""
    if rounds_done >= rounds:
        return "Refine redoes what changed"
    verb = "goes on in" if rounds_begun > rounds_done else "does"
    return f"Refine {verb} round {rounds_done} ({rounds} in all)"
