"""The room's own planes as a shape prior, and depth without holes by them.

Uses ``stereo``. Begin with ``planes``, then ``completion``.
"""
