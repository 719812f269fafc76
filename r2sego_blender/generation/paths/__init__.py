"""Camera paths tau_v, around what stands between.

Begin with ``paths``.
"""
