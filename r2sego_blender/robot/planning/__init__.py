"""Where in a room the declared behaviours fit: free floor, ways over it, seats, and a drawn course.

Uses ``behaviours``, ``model`` and ``scope``. Begin with ``course``.
"""
