"""The elimination that Newton's method uses for periods of a motion."""

import numpy as np

from tests.compiled.plants import entry
from tpd.compiled import period_map

eliminate = entry(period_map.eliminate)


def test_elimination_solves_and_reports_a_singular_matrix():
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b = rng.normal(size=(4, 4)), rng.normal(size=(4, 3))
        a[0, 0] = 0.0
        x = b.copy()
        assert eliminate(a.copy(), x) > 0.0
        np.testing.assert_allclose(a @ x, b, rtol=0, atol=1e-11)
    for added in (0.0, np.nan):
        singular = np.ones((4, 4))
        singular[3, 3] += added
        assert not eliminate(singular, np.ones((4, 1))) > 1e-12
