"""``small_bundle`` can be imported by every test here."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
