"""From counts to newtons: zero and span of each load cell with known weights, and the file that keeps them.

Uses ``trials/stream`` and ``core``. Begin with ``calibration``.
"""
