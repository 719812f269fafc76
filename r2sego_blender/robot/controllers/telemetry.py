"""onnxruntime with its telemetry switched off: the one place that imports it.

From 1.29 on its packages say by default who runs what: an identifier and a database in the person's
cache folder, and uploads to mobile.events.data.microsoft.com.
"""

from __future__ import annotations

import os
from types import ModuleType

# A whole opt-out, but on Windows, where it has to be there before the first import: nothing is made,
# kept or sent then (microsoft/onnxruntime#27379, #29843).
OPT_OUT = {"ORT_DISABLE_TELEMETRY": "1"}
"""Variables of a process in which onnxruntime tells nobody anything."""


def onnxruntime_without_telemetry() -> ModuleType:
    """The module ``onnxruntime``; imported elsewhere first, it would have begun to tell."""
    os.environ.update(OPT_OUT)
    import onnxruntime

    onnxruntime.disable_telemetry_events()  # on Windows, where the system is told; elsewhere it is off already
    module: ModuleType = onnxruntime
    return module
