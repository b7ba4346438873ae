"""The subproblem of a step against a linear programme, and constraints that cannot matter."""

import numpy as np
import pytest
from scipy.optimize import linprog

from tpd.design.subproblem import PENALTY, Linearisation, solve_subproblem, within_reach


def local(rng, m, n, limit, d=3):
    """Random functions, and constraints of values `limit` (m, l), at m designs."""
    slopes = rng.normal(size=(m, n)), rng.normal(size=(m, n, d))
    return Linearisation(*slopes, limit, rng.normal(size=(*limit.shape, d)))


def test_constraints_out_of_reach_are_left_out_and_nothing_else():
    rng, n, d, many = np.random.default_rng(7), 5, 3, 200
    far = rng.normal(size=(4, many)) - 2.2
    at = local(rng, 4, n, far)
    box = np.full((4, d), -0.3), np.full((4, d), 0.2)
    curve = np.tile(np.eye(d), (4, 1, 1))
    move, gain, weights = solve_subproblem(at, curve, box, 1.0, np.zeros(4))
    assert np.any(weights[1] > 1e-3), "one of them holds"
    assert within_reach(at, box).shape == (4, 64)
    most = far + np.maximum(at.limit_slope * -0.3, at.limit_slope * 0.2).sum(axis=2)
    # Each has constraints of its own number: one program each.
    for i in (0, 3):
        one, rows = at.at(slice(i, i + 1)), np.flatnonzero(most[i] > -0.5)
        alone = one._replace(limit=one.limit[:, rows], limit_slope=one.limit_slope[:, rows])
        again = solve_subproblem(alone, curve[[i]], (box[0][[i]], box[1][[i]]), 1.0, np.zeros(1))
        np.testing.assert_allclose(move[i], again[0][0], atol=1e-6)
        assert gain[i] == pytest.approx(again[1][0], rel=1e-6)
        np.testing.assert_allclose(weights[1][i, rows], again[2][1][0], atol=1e-4)


@pytest.mark.parametrize("cap", [1.0, 0.4, 1.0 / 12])
def test_the_subproblem_is_the_linear_programme(cap):
    rng, n, d = np.random.default_rng(5), 12, 3
    functions = rng.normal(size=(8, n)), rng.normal(size=(8, n, d))
    at = Linearisation(*functions, rng.normal(size=(8, 4)), rng.normal(size=(8, 4, d)))
    box = np.full((8, d), -0.3), np.full((8, d), 0.2)
    flat = np.tile(1e-12 * np.eye(d), (8, 1, 1))
    move, gain, weights = solve_subproblem(at, flat, box, cap, np.zeros(8))
    assert np.all(move >= -0.3)
    assert np.all(move <= 0.2)
    np.testing.assert_allclose(weights[0].sum(axis=1), 1.0, rtol=2e-4)
    assert weights[0].max() <= cap * (1 + 1e-9)
    for i in range(8):
        functions = np.hstack([at.slope[i], -np.ones((n, 1)), -np.eye(n), np.zeros((n, 4))])
        limits = np.hstack([at.limit_slope[i], np.zeros((4, 1 + n)), -np.eye(4)])
        answer = linprog(
            np.r_[np.zeros(d), 1.0, cap * np.ones(n), PENALTY * np.ones(4)],
            A_ub=np.vstack([functions, limits]),
            b_ub=-np.r_[at.value[i], at.limit[i]],
            bounds=[(-0.3, 0.2)] * d + [(None, None)] + [(0, None)] * (n + 4),
        )
        assert -gain[i] == pytest.approx(answer.fun, rel=1e-4, abs=1e-4)


def test_no_constraint_at_all():
    at = local(np.random.default_rng(1), 2, 3, np.zeros((2, 0)))
    box, flat = (np.full((2, 3), -0.1), np.full((2, 3), 0.1)), np.tile(1e-9 * np.eye(3), (2, 1, 1))
    move, gain, (on, by) = solve_subproblem(at, flat, box, 1.0, at.value.max(axis=1))
    assert by.shape == (2, 0)
    assert np.all(np.isfinite(move))
    assert np.all(gain > 0.0)
    np.testing.assert_allclose(on.sum(axis=1), 1.0, rtol=1e-6)


def test_the_curvature_bends_the_step():
    """One function x with B = 2 I: the unconstrained minimum of x + x^2 is at -1/2."""
    zero = np.zeros((1, 1, 1))
    at = Linearisation(np.zeros((1, 1)), np.ones((1, 1, 1)), np.full((1, 1), -1.0), zero)
    box = np.full((1, 1), -2.0), np.full((1, 1), 2.0)
    move, gain, _ = solve_subproblem(at, np.full((1, 1, 1), 2.0), box, 1.0, np.zeros(1))
    assert move[0, 0] == pytest.approx(-0.5, abs=1e-6)
    assert gain[0] == pytest.approx(0.25, abs=1e-8)
