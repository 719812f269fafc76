"""The plan of a study: declared by a person, drawn once, frozen before the first trial.

Uses the index in ``records``, ``bundle``, ``config`` and ``core``. Begin with ``trial_plan``; ``declaration`` is what
a person writes, ``drawing`` makes the plan of it, ``study`` keeps it in its folder, ``page`` prints it, ``next_trial``
walks through it.
"""
