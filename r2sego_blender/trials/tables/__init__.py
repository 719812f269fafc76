"""What a study shows: the paper's Table 3 and its figure, every trial with units, kinds of failure.

Uses ``plan`` and the index in ``records``. Begin with ``counts`` (what is counted) and ``statistics`` (means and
standard deviations over policies); ``success_table``, ``trials_file`` and ``success_figure`` write them.
"""
