"""Photographs and the poses that somebody solved: pose files, COLMAP's models, plain folders.

Uses ``captures``' own files and ``lenses``. Begin with ``registry``, which finds poses of every kind in
``formats``, and ``photographs``.
"""
