"""Weighted depth maps in, a surface out: the slot's backends.

Begin with ``backends``.
"""
