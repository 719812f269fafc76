"""``python -m r2sego_blender …`` is the command ``r2sego …``."""

from .commands.cli import main

main(prog_name="r2sego")
