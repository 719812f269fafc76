"""Poses where none are given, or where they are nearly right.

Uses ``matching`` and ``poses``. Begin with ``solving``.
"""
