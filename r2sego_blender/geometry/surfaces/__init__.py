"""Weighted depth maps in, a surface out: each backend is a file.

Begin with ``backends``.
"""
