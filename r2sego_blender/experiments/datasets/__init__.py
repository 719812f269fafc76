"""Other people's data sets: which photographs of a scene are captures, and which are held out.

Uses the readers of ``captures.poses``. A set is one file in ``sets`` that offers ``DATASET``; begin with ``dataset``,
what it says of itself. ``registry`` finds them, ``splits`` and ``colmap_split`` choose captures, ``published`` puts
others' figures below an experiment's tables; ``staging``, one folder up, writes a scene as every plan reads one.
"""
