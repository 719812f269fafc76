"""An engine's Python that answers from a script, ``tests/operators/fake_engine.py``."""

from pathlib import Path

from stand_in_program import write_program

_SCRIPT = Path(__file__).parents[1] / "operators" / "fake_engine.py"


def write_stand_in_engine(folder: Path, conduct: str = "succeed") -> Path:
    """Write it as ``folder``/engine/python; its conduct and its calls stand beside it."""
    (folder / "engine").mkdir(parents=True)
    engine = write_program(folder / "engine" / "python", _SCRIPT.read_text(encoding="utf-8"))
    (engine.parent / "conduct.txt").write_text(conduct)
    return engine
