import os
import subprocess
import sys

import pytest


@pytest.mark.skipif(os.name == "nt", reason="there os.kill ends a process at once")
def test_loading_keeps_the_handler_that_ends_the_work():
    code = (
        "import os, signal\n"
        "from r2sego_blender.captures.colmap import load_pycolmap\n"
        "signal.signal(signal.SIGTERM, lambda *_: print('ended cleanly'))\n"
        "load_pycolmap()\n"
        "os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "ended cleanly", "")
