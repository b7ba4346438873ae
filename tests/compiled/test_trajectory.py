"""States of motions under a harmonic: to 50 digits, late, and with derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import (
    OVERTURNING,
    REST,
    WITH,
    along,
    differences,
    exact,
    parameters,
)
from tests.truth import load
from tpd import Piecewise, Status, simulate, status_name
from tpd.compiled.rows import row_of
from tpd.scene.parameters import from_row

ROWS = [r for r in load("harmonic") if r["what"] == "transient"]
REACH = 1e-11
FOLLOW = jax.jit(lambda x, y0, times: simulate(parameters(x), y0, times, model=Piecewise(max_events=4000)))
SAMPLES = 201
"""Of most trajectories here, so that one compilation serves them all."""
STICKING = (0.19, 0.09, 0.5, 0.56, 0.05, 0.27, 3.4, 0.8)
"""Attracting, held for a part of every period; the largest multiplier is 0.18."""


def full(x):
    return np.array([*x, *[1.0] * (8 - len(x))])


def states(x, y0, times):
    motion = FOLLOW(full(x), np.asarray(y0, dtype=float), times)
    assert status_name(motion.status) == "rocking"
    return np.asarray(motion.ys)


def clock(x, periods, begin=0.0):
    """Times that cover so many forcing periods."""
    return begin + np.linspace(0.0, periods * 2.0 * np.pi / x[6], SAMPLES)


def scales(x):
    rate = max(1.0, x[6])
    return x[0] * np.array([1.0, 1.0, rate, rate])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_the_final_state_agrees_with_a_solution_of_fifty_digits(row):
    x = np.array(row["parameters"])
    times = np.linspace(0.0, row["periods"] * 2.0 * np.pi / x[6], SAMPLES)
    end = np.array([float(v) for v in row["end"]])
    error = np.abs(states(x, row["y0"], times)[-1] - end) / scales(x)
    assert error[[0, 2] if x[1] == 0 else slice(None)].max() < REACH


def test_a_motion_reaches_every_end_time_in_a_few_events():
    # After an event at t, t + (horizon - t) may round below the horizon: this once waited for ever.
    p = parameters((0.25, 0.0, 0.2, 0.1, 0.05, 0.377, 2.67))
    y0, few = np.array([0.2999, 0.0, 0.0, 0.0]), Piecewise(max_events=20)
    for horizon in np.random.default_rng(8).uniform(0.15, 0.35, 50):
        assert simulate(p, y0, np.array([0.0, horizon]), model=few).status == Status.rocking


def test_states_and_derivatives_are_nan_after_overturning():
    ys, slopes, status = along(OVERTURNING, REST, clock(OVERTURNING, 20))
    assert status == "overturned"
    for numbers in (ys, slopes):
        assert np.all(np.isfinite(numbers[:20]))
        assert np.all(np.isnan(numbers[-1]))


@pytest.mark.parametrize("share", [0.0, 0.37])
def test_a_late_period_equals_the_first_one(share):
    # Times of N periods have an error of the last digit of N, and rates of the order of one turn it into one
    # of the state.
    y0, period = exact(STICKING).steady.state, 2.0 * np.pi / STICKING[6]
    first = states(STICKING, y0, (share + np.array([0.0, 0.4, 1.0])) * period)
    for count in (1, 100, 10_000, 1_000_000):
        ys = states(STICKING, y0, (count + share + np.array([0.0, 0.4, 1.0])) * period)
        np.testing.assert_allclose(ys, first, rtol=0, atol=1e-13 + 1e-15 * count)


@pytest.mark.parametrize("count", [0, 300])
def test_derivatives_of_early_and_late_states_equal_finite_differences(count):
    times = (count + 0.37 + np.array([0.0, 1.4, 2.3])) * 2.0 * np.pi / STICKING[6]
    point = np.array([*row_of(parameters(STICKING)), *exact(STICKING).steady.state, times[0], times[-1]])

    @jax.jit
    def end(z):
        clock = jnp.asarray(times).at[0].set(z[-2]).at[-1].set(z[-1])
        return simulate(from_row(z[:-6]), z[-6:-2], clock).ys[1:]

    slopes = jax.jit(jax.jacfwd(end))(point)
    for i in range(15):
        share = 1e-4 / (1.0 + count) if i < 9 else 1e-4 / max(abs(point[i]), 1.0)
        expected = differences(end, point, i, share=share)
        reach = 1e-6 * (1.0 + count) * (1.0 + np.abs(expected).max())
        np.testing.assert_allclose(slopes[..., i], expected, rtol=1e-5, atol=reach)


def test_second_derivatives_of_a_trajectory_are_nan():
    def end(x):
        return simulate(parameters((*x, *WITH[0].x[2:])), np.zeros(4), clock(WITH[0].x, 2)).ys[-1, 0]

    assert np.all(np.isnan(jax.hessian(end)(jnp.array(WITH[0].x[:2]))))
