"""``python -m r2sego_blender …`` is the command ``r2sego …``."""

import sys


def main() -> None:
    """The command."""
    try:
        from .commands.cli import main as command
    except KeyboardInterrupt:  # nothing has begun
        sys.exit(130)
    command(prog_name="r2sego")


if __name__ == "__main__":
    main()
