"""The candidate stream and the target views in the 3D view.

Uses ``shared``.
"""
