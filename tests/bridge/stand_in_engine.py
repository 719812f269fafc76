"""An engine's Python that answers from a script, ``tests/operators/fake_engine.py``."""

import sys
from pathlib import Path

_SCRIPT = Path(__file__).parents[1] / "operators" / "fake_engine.py"


def write_stand_in_engine(folder: Path, conduct: str = "succeed") -> Path:
    """Write it as ``folder``/engine/python; its conduct and its calls stand beside it."""
    engine = folder / "engine" / "python"
    engine.parent.mkdir(parents=True)
    engine.write_text(f"#!{sys.executable}\n{_SCRIPT.read_text()}")
    engine.chmod(0o755)
    (engine.parent / "conduct.txt").write_text(conduct)
    return engine
