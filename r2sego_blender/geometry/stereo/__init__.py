"""Dense stereo on the posed captures, and the observed geometry M_obs that it gives.

Begin with ``stereo``, then ``observed``.
"""
