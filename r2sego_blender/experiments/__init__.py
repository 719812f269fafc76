"""Experiments: a plan of scenes, capture counts, arms, seeds and presets, run as cells, and their tables.

Uses ``evaluation`` and what that stands on; a cell is the program's own commands on a bundle. Begin with ``plan``, what
a person declares, and ``experiment``, which runs it. ``cells`` says what a cell is, ``running`` does one,
``scheduling`` many, on this machine (``local_runner``) or on a cluster (``ray_runner``); ``gathering`` makes tables of
what they left.
"""
