"""The slot of the video generator G_theta, and the embedded one.

Uses ``conditions``. Begin with ``slot`` and ``registry``; ``blending`` is the embedded generator.
"""
