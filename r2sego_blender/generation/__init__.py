"""Ego-view generation: from a target view to a registered pseudo-observation (Eq. 3).

Uses ``views``, ``geometry``, ``captures`` and ``workers``. Begin with ``ego_views``.
"""
