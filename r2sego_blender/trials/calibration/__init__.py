"""From counts to newtons: zero and span of each load cell with known weights, and the test before a session.

Uses ``trials/stream`` and ``core``. Begin with ``calibration``; ``self_test`` says whether a device at
rest behaves as it was calibrated.
"""
