"""Risk measures against linear programmes."""

import numpy as np
import pytest
from scipy.optimize import linprog

import tpd


@pytest.mark.parametrize("share", [0.07, 0.1, 0.37, 0.5, 0.99])
def test_a_conditional_value_at_risk_is_the_largest_mean_with_capped_weights(share):
    for n in (1, 2, 7, 12):
        row = np.random.default_rng(n).normal(size=n)
        bounds = [(0.0, min(1.0, 1.0 / (share * n)))] * n
        answer = linprog(-row, A_eq=np.ones((1, n)), b_eq=[1.0], bounds=bounds)
        assert tpd.Risk.cvar(share).of(row) == pytest.approx(-answer.fun, rel=1e-9)


def test_an_infinite_tilt_makes_a_risk_infinite_only_if_it_has_a_weight():
    values = np.array([[1.0, np.inf, 2.0, 3.0]])
    assert tpd.Risk.worst().of(values)[0] == np.inf
    assert tpd.Risk.cvar(0.5).of(values)[0] == np.inf
    assert tpd.Risk.worst().of(np.array([[1.0, -np.inf]]))[0] == 1.0


def test_a_share_above_one_is_rejected():
    with pytest.raises(ValueError, match="`share` must be between"):
        tpd.Risk.cvar(1.1)
