"""Long times in whole forcing periods: late motions of the integrated models are the first ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tpd.models.clock import split

from tests.exact.test_trajectory import STICKING
from tests.reference import HUNG, exact, parameters
from tpd import Segmented, Smoothed, Terms, simulate, status_name
from tpd.exact.follow import through
from tpd.scene.parameters import as_arrays
from tpd.scene.status import Status


def test_times_are_whole_periods_and_what_is_left_with_their_derivatives():
    p = as_arrays(parameters(HUNG[0].x))
    period = float(p.period)
    times = jnp.array([0.0, 0.3, 1.0 - 1e-13, 7.25, 1e6 + 0.5]) * period
    whole, since = split(p, times)
    assert whole.tolist() == [0.0, 0.0, 1.0, 7.0, 1e6]
    np.testing.assert_allclose(since / period, [0.0, 0.3, 0.0, 0.25, 0.5], rtol=0, atol=1e-9)
    slopes = jax.jacfwd(lambda t: split(p, t)[1])(times)
    np.testing.assert_array_equal(slopes, np.eye(5))


def test_legs_end_at_every_time_and_at_every_period_and_a_failure_ends_all():
    p = as_arrays(parameters(HUNG[0].x))

    def leg(y, seen, begin, end):
        failed = Status.where(seen >= 4, Status.event_bound, Status.rocking)
        return y + (end - begin), seen + 1, failed

    times = jnp.array([0.2, 0.6, 2.1, 9.0]) * p.period
    ys, status = through(p, jnp.zeros(4), jnp.zeros((), int), times, leg)
    np.testing.assert_allclose(ys[1:3, 0], (times - times[0])[1:3], rtol=1e-12)
    assert status_name(status) == "event_bound"
    assert np.all(np.isnan(ys[3]))


@pytest.mark.parametrize(
    ("model", "error"),
    [(Segmented(terms=Terms.linear), 1e-6), (Smoothed(rtol=1e-9), 1e-5)],
    ids=["segmented", "smoothed"],
)
def test_a_period_that_begins_late_is_the_first_one_of_integrated_models(model, error):
    x = STICKING if isinstance(model, Segmented) else STICKING[:7]
    y0, period = np.asarray(exact(x).steady.state), 2.0 * np.pi / x[6]

    @jax.jit
    def solve(times):
        motion = simulate(parameters(x), y0, times, model=model)
        return motion.ys, motion.status

    first, _ = solve(np.array([0.0, 0.4, 1.0]) * period)
    for count in (1, 1_000, 1_000_000):
        ys, status = solve((count + np.array([0.0, 0.4, 1.0])) * period)
        assert status_name(status) == "rocking"
        np.testing.assert_allclose(ys, first, rtol=0, atol=error)
