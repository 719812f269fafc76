"""Photographs and the poses that somebody solved: pose files, COLMAP's models, plain folders.

Uses ``captures``' own files and ``lenses``. Begin with ``photographs``; each kind of pose file has a file.
"""
