"""The paired experiment (the paper's Table 3): a policy for each visual asset and seed, tested, and the table.

Uses ``training`` and ``statistics``. Begin with ``experiment``.
"""
