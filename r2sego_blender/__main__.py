"""``python -m r2sego_blender …`` is the command ``r2sego …``."""

import sys


def main() -> None:
    """The command."""
    try:
        from .commands.cli import main as command
        from .workers.library_path import leave_working_folder_unsearched
    except KeyboardInterrupt:  # nothing has begun
        sys.exit(130)
    leave_working_folder_unsearched()
    command(prog_name="r2sego")


if __name__ == "__main__":
    main()
