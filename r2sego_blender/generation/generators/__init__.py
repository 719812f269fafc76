"""The slot of the video generator G_theta: each generator is a file.

Uses ``conditions``. Begin with ``slot`` and ``registry``; ``blending`` is the embedded one.
"""
