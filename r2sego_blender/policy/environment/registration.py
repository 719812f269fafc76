"""The environments' ids in Gymnasium: ``gymnasium.make("r2sego_blender.policy:r2sego/Sit-v0", bundle=...)``."""

from __future__ import annotations

SIT, WALK = "r2sego/Sit-v0", "r2sego/Walk-v0"


def register() -> None:
    """Tell Gymnasium the ids; nothing where it is not installed."""
    try:
        import gymnasium
    except ImportError:
        return
    for name, made in ((SIT, "SitEnv"), (WALK, "WalkEnv")):
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=f"{__package__}.environments:{made}")
