"""Declared objects: their masks, shapes that may become their priors, and the alignment T_m*.

Uses ``stereo``, ``room`` and ``surfaces``. Begin with ``objects``, then ``priors``.
"""
