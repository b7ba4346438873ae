"""Motions over many forcing periods, and motions that begin late: only the phase of the forcing matters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, differences, exact, parameters
from tpd import Piecewise, Segmented, Smoothed, Terms, simulate, status_name

STICKING = (0.19, 0.09, 0.5, 0.56, 0.05, 0.27, 3.4, 0.8)
"""Attracting, held for a part of every period; the largest multiplier is 0.18."""
LATE = (1, 100, 1_000, 10_000, 1_000_000)


@jax.jit
def run(x, y0, times):
    motion = simulate(parameters(x), y0, times)
    return motion.ys, motion.status


def period(x):
    return 2.0 * np.pi / x[6]


@pytest.mark.parametrize("samples", [2, 1001])
def test_a_sticking_orbit_is_found_again_after_a_thousand_periods(samples):
    times = np.linspace(0.0, 1000.0, samples) * period(STICKING)
    ys, status = run(np.array(STICKING), np.zeros(4), times)
    assert exact(STICKING).status == "sticking"
    assert status_name(status) == "rocking"
    np.testing.assert_allclose(ys[-1], exact(STICKING).steady.state, rtol=0, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.37])
def test_a_period_that_begins_late_is_the_first_one(share):
    # Times of N periods have an error of the last digit of N, and rates of the order of one turn it into one
    # of the state.
    x, y0 = np.array(STICKING), np.asarray(exact(STICKING).steady.state)
    first, _ = run(x, y0, (share + np.array([0.0, 0.4, 1.0])) * period(x))
    for count in LATE:
        ys, status = run(x, y0, (count + share + np.array([0.0, 0.4, 1.0])) * period(x))
        assert status_name(status) == "rocking"
        np.testing.assert_allclose(ys, first, rtol=0, atol=1e-13 + 1e-15 * count)


@pytest.mark.parametrize(
    ("model", "error"),
    [(Segmented(terms=Terms.linear), 1e-6), (Smoothed(rtol=1e-9), 1e-5)],
    ids=["segmented", "smoothed"],
)
def test_a_period_that_begins_late_is_the_first_one_of_integrated_models(model, error):
    x = STICKING if isinstance(model, Segmented) else STICKING[:7]
    y0 = np.asarray(exact(x).steady.state)

    @jax.jit
    def solve(times):
        motion = simulate(parameters(x), y0, times, model=model)
        return motion.ys, motion.status

    first, _ = solve(np.array([0.0, 0.4, 1.0]) * period(x))
    for count in LATE:
        ys, status = solve((count + np.array([0.0, 0.4, 1.0])) * period(x))
        assert status_name(status) == "rocking"
        np.testing.assert_allclose(ys, first, rtol=0, atol=error)


def test_one_long_leg_of_segments_is_as_good_as_short_ones():
    x = HUNG[0].x
    model = Segmented(terms=Terms.linear, max_events=30)
    times = np.array([0.0, 20.0]) * period(x)
    motion = simulate(parameters(x), exact(x).steady.state, times, model=model)
    assert status_name(motion.status) == "rocking"
    np.testing.assert_allclose(motion.ys[-1], exact(x).steady.state, rtol=0, atol=1e-5)


@pytest.mark.parametrize("share", [0.0, 0.37])
@pytest.mark.parametrize("count", [0, 300])
def test_derivatives_of_late_states_are_those_of_differences(count, share):
    x, y0 = np.array(STICKING), np.asarray(exact(STICKING).steady.state)
    times = (count + share + np.array([0.0, 2.3])) * period(x)

    def end(x, y0, times):
        return simulate(parameters(x), y0, times).ys[-1]

    by_x, by_y0, by_times = jax.jit(jax.jacfwd(end, argnums=(0, 1, 2)))(x, y0, times)

    def late(function, x, i):
        return differences(function, x, i, share=1e-4 / (1.0 + count))

    for i in range(8):
        expected = late(lambda x: np.asarray(run(x, y0, times)[0][-1]), x, i)
        np.testing.assert_allclose(by_x[:, i], expected, rtol=1e-5, atol=1e-6 * (1.0 + count))
    for i in range(4):
        expected = differences(lambda y: np.asarray(run(x, y, times)[0][-1]), y0, i, share=1e-4)
        np.testing.assert_allclose(by_y0[:, i], expected, rtol=1e-5, atol=1e-7)
    for i in range(2):
        expected = differences(
            lambda t: np.asarray(run(x, y0, t)[0][-1]), times, i, share=1e-4 / max(times[i], 0.1)
        )
        np.testing.assert_allclose(by_times[:, i], expected, rtol=1e-5, atol=1e-7)


def test_derivatives_at_the_end_of_a_period_are_those_of_segments_too():
    x = np.array(HUNG[0].x)
    y0 = np.asarray(exact(x).steady.state)
    times = np.array([2.0, 3.0]) * period(x)

    def slopes(model):
        def end(x, times):
            return simulate(parameters(x), y0, times, model=model).ys[-1]

        return jax.jit(jax.jacfwd(end, argnums=(0, 1)))(x, times)

    known, found = slopes(Piecewise()), slopes(Segmented(terms=Terms.linear, rtol=1e-9))
    for a, b in zip(known, found, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-4, atol=1e-5 * float(jnp.max(jnp.abs(a))))
