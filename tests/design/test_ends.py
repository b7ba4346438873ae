"""What is left to gain at an end, and what holds it, against the dual of its linear programme."""

import numpy as np
import pytest
from scipy.optimize import linprog
from tpd.design.ends import PENALTY, Book, Linearisation, merit_of

import tpd

STEP = 1e-4
AT = np.array([[0.5, 0.5, 0.5], [0.0, 1.0, 0.3], [1.0, 0.2, 1.0 - 0.3 * STEP]])
"""In the middle of the bounds, at some of them, and nearer to one than the step."""


def local(limits: int, n: int = 12) -> Linearisation:
    """Random functions, several of them nearly equal, and constraints, several of them nearly met."""
    rng, m = np.random.default_rng(5), len(AT)
    value, limit = 1e-4 * rng.normal(size=(m, n)), 1e-4 * rng.normal(size=(m, limits))
    value[:, ::3] -= 1.0
    limit[:, ::3] -= 1.0
    return Linearisation(value, rng.normal(size=(m, n, 3)), limit, rng.normal(size=(m, limits, 3)))


@pytest.mark.parametrize("cap", [1.0, 0.4, 1.0 / 12])
@pytest.mark.parametrize("limits", [0, 4])
def test_gain_and_weights_are_those_of_the_dual_programme(cap, limits):
    at, risk = local(limits), tpd.Risk.cvar(1.0 / (12 * cap))
    ends = Book(lambda x: at, risk.of, AT).ends(cap)
    np.testing.assert_array_equal(ends.merit, merit_of(at, risk.of))
    low, high = np.maximum(-STEP, -AT), np.minimum(STEP, 1.0 - AT)
    for i in range(len(AT)):
        value = np.r_[at.value[i], at.limit[i]]
        slope = np.r_[at.slope[i], at.limit_slope[i]]
        weights = np.r_[ends.weights[0][i], ends.weights[1][i]]
        most = np.r_[np.full(12, cap), np.full(limits, PENALTY)]
        assert np.all((weights >= -1e-9) & (weights <= most + 1e-9))
        assert ends.weights[0][i].sum() == pytest.approx(1.0, abs=1e-9)
        # The largest bound: w value - sum r under r >= -low w slope, r >= -high w slope.
        best = linprog(
            np.r_[-value, np.ones(3)],
            A_ub=np.vstack([np.hstack([-side[i][:, None] * slope.T, -np.eye(3)]) for side in (low, high)]),
            b_ub=np.zeros(6),
            A_eq=np.r_[np.ones(12), np.zeros(limits + 3)][None],
            b_eq=[1.0],
            bounds=[*((0.0, x) for x in most), *[(None, None)] * 3],
        )
        left = ends.merit[i] - STEP * ends.stationarity[i]
        assert left == pytest.approx(-best.fun, abs=1e-9)
        turn = weights @ slope
        bound = weights @ value + np.minimum(low[i] * turn, high[i] * turn).sum()
        assert bound == pytest.approx(left, abs=1e-9)
    assert ends.stationarity.min() > 0.1
    assert ends.open.all()


def test_of_a_value_that_is_not_finite_nothing_is_told_and_the_others_are_as_before():
    at = local(4)
    before = Book(lambda x: at, tpd.Risk.worst().of, AT, at).ends(1.0)
    at.value[1, 2] = np.inf
    ends = Book(lambda x: at, tpd.Risk.worst().of, AT).ends(1.0)
    assert ends.open.tolist() == [True, True, True]
    assert np.isnan(ends.stationarity[1])
    assert np.sum(ends.weights[0][1]) == np.sum(ends.weights[1][1]) == 0.0
    np.testing.assert_array_equal(ends.stationarity[::2], before.stationarity[::2])
