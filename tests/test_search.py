"""The search's parts: the linear programme of a step, the starting points, the trace."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import tpd
from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import as_arrays
from tpd.design.result import StartStatus
from tpd.design.single_polish import knapsack
from tpd.design.single_search import Trace, start_status, starting_points, trace, with_design


@pytest.mark.parametrize(("seed", "size"), list(itertools.product(range(40), (2, 3))))
def test_knapsack_solves_the_linear_programme(seed, size):
    rng = np.random.default_rng(seed)
    cost, weight = rng.normal(size=size), rng.normal(size=size)
    low, high = -rng.random(size), rng.random(size)
    capacity = rng.normal() * 0.5
    expected = linprog(cost, A_ub=weight[None], b_ub=[capacity], bounds=list(zip(low, high, strict=True)))
    d = knapsack(cost, low, high, weight, capacity)
    assert np.all(d >= low - 1e-12)
    assert np.all(d <= high + 1e-12)
    if expected.status == 0:
        assert weight @ d <= capacity + 1e-12
        assert cost @ d == pytest.approx(expected.fun, abs=1e-9)
    else:
        assert weight @ d == pytest.approx(np.minimum(weight * low, weight * high).sum())


def test_starting_points_are_seeded_and_inside_and_half_of_them_cannot_lift():
    p, space = as_arrays(tpd.paper_scene().parameters()), tpd.DesignSpace()
    points = starting_points(p, space, 64, seed=3)
    assert points.shape == (64, 3)
    assert np.array_equal(points, starting_points(p, space, 64, seed=3))
    assert not np.array_equal(points, starting_points(p, space, 64, seed=4))
    low, high = space.bounds
    assert np.all((points[:, :2] >= low) & (points[:, :2] <= high))
    assert np.all(points[:, 2] == 0.1)
    lifts = [uplift(with_design(p, jnp.asarray(x))) for x in points[32:]]
    still = [float(u.margin) > -1e-3 and float(u.stroke) <= space.stroke for u in lifts]
    assert np.mean(still) > 0.8, "the closed forms lead to designs that never lift"


def test_damping_is_searched_only_when_asked_for():
    p = as_arrays(tpd.paper_scene().parameters())
    space = tpd.DesignSpace(damping_ratio=(0.05, 0.3))
    points = starting_points(p, space, 16, seed=0)
    assert space.names == ("mu", "lam", "zeta")
    assert len(np.unique(points[:, 2])) > 8
    assert tpd.DesignSpace().names == ("mu", "lam")


def _trace(**changed) -> Trace:
    """One start of three steps whose best, the second, is inside the space with a slope."""
    values = {
        "designs": np.array([[[0.1, 0.5, 0.1], [0.1, 0.6, 0.1], [0.1, 0.7, 0.1]]]),
        "merit": np.array([[0.3, 0.2, 0.1]]),
        "amplitude": np.array([[0.3, 0.2, 0.1]]),
        "stroke": np.array([[0.1, 0.2, 0.9]]),
        "margin": np.array([[-0.1, -0.1, -0.1]]),
        "status": np.array([["rocking"] * 3]),
        "slope": np.full((1, 3, 2), 1.0),
        "stroke_slope": np.zeros((1, 3, 2)),
        "usable": np.ones((1, 3), bool),
    }
    return Trace(**values | changed)


def test_the_best_design_keeps_the_stroke_limit():
    assert _trace().best(0.5).tolist() == [1]
    assert _trace(stroke=np.full((1, 3), 0.9)).best(0.5).tolist() == [-1]


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, StartStatus.steps_exhausted),
        ({"slope": np.full((1, 3, 2), 1e-3)}, StartStatus.converged),
        ({"designs": np.array([[[0.01, 0.1, 0.1]] * 3])}, StartStatus.at_bound),
        ({"stroke": np.array([[0.1, 0.499, 0.9]])}, StartStatus.stroke_limited),
        ({"status": np.array([["rest"] * 3])}, StartStatus.rests),
        ({"stroke": np.full((1, 3), 0.9)}, StartStatus.infeasible),
        ({"usable": np.zeros((1, 3), bool)}, StartStatus.lost),
    ],
)
def test_every_start_ends_with_a_status(changed, expected):
    t, space = _trace(**changed), tpd.DesignSpace()
    assert start_status(t, space, 0, int(t.best(space.stroke)[0])) is expected


def test_a_search_stopped_at_once_has_an_empty_trace():
    empty = trace([], 4)
    assert empty.designs.shape == (4, 0, 3)
    assert empty.best(0.5).tolist() == [-1] * 4
    assert empty.then(empty).merit.shape == (4, 0)
