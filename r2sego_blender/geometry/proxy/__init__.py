"""The geometry proxy M_scaf: composed, edited by hand, and the floor that it vouches for.

Uses all of ``geometry`` but ``collision`` and ``texture``. Begin with ``proxy``, then ``fusion``.
"""
