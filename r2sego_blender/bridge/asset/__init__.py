"""The visual asset as points, pictures and marks.

Uses ``shared``.
"""
