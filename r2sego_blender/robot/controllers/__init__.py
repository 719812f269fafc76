"""The slot of the behaviour controller mu_B: tracking, learned policies, recorded motions.

Uses ``motion`` and ``behaviours``. Begin with ``controller``.
"""
