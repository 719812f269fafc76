"""The poses of a trial on a real robot, drawn on the floor.

Uses ``shared``. The study's folder stands in place of a bundle's.
"""
