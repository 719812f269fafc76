"""Statistics of few values."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.statistics import weighted_median

COUNTED = st.lists(st.tuples(st.integers(-50, 50), st.integers(1, 9)), min_size=1, max_size=20)


@given(COUNTED)
def test_what_counts_n_times_counts_as_n_values(counted):
    values, counts = np.array(counted, np.float64).T
    repeated = np.sort(np.repeat(values, counts.astype(int)))
    assert weighted_median(values, counts) == repeated[(len(repeated) - 1) // 2]
