"""Where the add-on keeps files of its own.

Uses ``shared``.
"""
