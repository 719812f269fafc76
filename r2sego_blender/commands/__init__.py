"""The command tree ``r2sego``, a file for what the commands are about.

Uses everything but ``bridge``; holds none of the method. Begin with ``cli``.
"""

import os

from ..core.threads import BLAS_VARIABLE

# Before NumPy is loaded: what is worth it runs on all cores by threads of this library's own.
os.environ.setdefault(BLAS_VARIABLE, "1")
