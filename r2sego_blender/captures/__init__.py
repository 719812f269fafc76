"""Captures: photographs with calibrated poses in the world frame.

Uses ``bundle``, ``config``, ``core`` and ``workers``. Begin with ``capture``, then ``importing``.
"""
