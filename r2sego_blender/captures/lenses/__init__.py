"""Lenses with distortion, and photographs freed of it.

Begin with ``lens``.
"""
