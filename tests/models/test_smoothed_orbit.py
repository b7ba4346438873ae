"""Steady states of the smoothed model: repetition, Newton's method, multipliers, and the exact motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import WITH, differences, parameters, smoothed
from tpd import Smoothed, Status, status_name
from tpd.compiled.rows import packed
from tpd.compiled.simulate import Run, SteadyNumbers
from tpd.models.base import scale_of
from tpd.models.smoothed_orbit import LONGEST, History, _compare, implicit, multipliers, refine, settle
from tpd.scene.parameters import as_arrays, from_row
from tpd.scene.status import names_of

CASE = WITH[0]
P = as_arrays(parameters(CASE.x))
A, B, C = (np.full(4, v) for v in (0.1, 0.2, 0.3))


def period(y, *, size=0.1, overturned=False, bounded=True):
    return jnp.asarray(y), size * jnp.array([1.0, 2.0]), jnp.asarray(overturned), jnp.asarray(bounded)


def after(*periods):
    none = np.full((LONGEST, 4), np.inf)
    none[0] = 0.5
    history = History(none, np.zeros((LONGEST, 2)), np.full(2, 0.5), 0, 0, False, True)
    for each in periods:
        history = history.add(each, jnp.ones(4), 1e-8)
    return history.run()


@pytest.mark.parametrize(
    ("periods", "name", "repeats"),
    [
        ([period(A), period(A)], "rocking", 1),
        ([period(A), period(B), period(A)], "rocking", 2),
        ([period(A), period(B), period(C)], "not_settled", 1),
        ([period(A), period(A, bounded=False)], "event_bound", 1),
        ([period(A, size=0.0), period(A, size=0.0)], "rest", 1),
        ([period(A), period(A, overturned=True)], "overturned", 1),
        ([period(A), period(np.full(4, np.nan))], "failed", 1),
    ],
)
def test_a_settled_motion_has_its_status_and_period(periods, name, repeats):
    settled = after(*periods)
    assert status_name(settled.status) == name
    assert int(settled.periods) == repeats
    assert int(settled.elapsed) == len(periods)


def test_settled_sizes_cover_the_last_periods_and_peaks_all_periods():
    settled = after(period(B, size=0.4), period(A, size=0.2), period(C, size=0.1), period(A, size=0.3))
    assert float(settled.settled_tilt) == pytest.approx(0.3)
    assert float(settled.settled_swing) == pytest.approx(0.6)
    assert float(settled.tilt) == pytest.approx(0.5)
    overturned = after(period(A, overturned=True))
    assert np.isinf(overturned.tilt)


def test_a_repetition_after_more_than_the_stored_periods_is_not_detected():
    states = [np.full(4, 0.01 * n) for n in range(LONGEST + 1)]
    repeats = [status_name(after(*map(period, [*x, states[0]])).status) for x in (states[:LONGEST], states)]
    assert repeats == ["rocking", "not_settled"]


@pytest.mark.parametrize(("decay", "name"), [(0.3, "rocking"), (0.99, "not_settled")])
def test_a_motion_settles_only_if_the_sum_of_its_further_changes_is_small(decay, name):
    states = (np.full(4, 0.5 + 9e-9 / (1.0 - decay) * decay**n) for n in range(1, 4))
    assert status_name(after(*map(period, states)).status) == name


def test_a_bob_without_mass_is_left_out_of_the_scales_by_default():
    without = as_arrays(parameters((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 4.0)))
    np.testing.assert_allclose(scale_of(without), [0.2, np.inf, 0.8, np.inf])
    np.testing.assert_allclose(scale_of(without, bob=jnp.asarray(True)), [0.2, 0.3, 0.8, 1.2])


def test_a_motion_is_simulated_until_it_repeats_or_reaches_the_bound():
    def settled(bound):
        return settle(lambda y: period(0.5 * y), P, jnp.full(4, 0.1), tolerance=1e-6, max_periods=bound)

    assert status_name(settled(5).status) == "not_settled"
    found = settled(50)
    assert status_name(found.status) == "rocking"
    assert 10 < int(found.elapsed) < 30


@jax.jit
def refined(x):
    """Return the orbit of the smoothed model from the rough end of a short motion."""
    p = from_row(packed(parameters(x).numbers))
    model = Smoothed(tolerance=1e-3, max_periods=60, cycle_rtol=1e-11)
    return refine(p, model, model.settle(p, jnp.zeros(4)), Status.__names__.index("rocking"))


@pytest.fixture(scope="module")
def orbit():
    return refined(np.array(CASE.x))


def test_newtons_method_closes_an_orbit_from_a_rough_guess(orbit):
    assert float(orbit.residual) < 1e-8
    np.testing.assert_allclose(orbit.end, orbit.y, rtol=0, atol=1e-8)
    assert float(orbit.sizes[0]) == pytest.approx(CASE.amplitude, rel=1e-3)


def test_derivatives_of_an_orbit_equal_differences_and_its_multipliers_its_model(orbit):
    sizes, slopes = implicit(orbit)
    assert float(sizes[0]) == pytest.approx(smoothed(CASE.x).amplitude, rel=1e-7)
    largest, nearest = multipliers(jnp.asarray(CASE.x[1]), orbit.by_state[:4])
    assert float(largest) == pytest.approx(float(smoothed(CASE.x).steady.multiplier), rel=1e-5)
    assert 0.0 < float(nearest) <= 1.0 + float(largest)
    # Leaves are nu, mu, lam, zeta, k, f and xi first; rho follows nu.
    for i in range(1, 7):
        expected = differences(lambda x: float(implicit(refined(x))[0][0]), CASE.x, i, share=2e-3)
        assert float(slopes[0, i]) == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_a_bob_without_mass_does_not_contribute_multipliers():
    by = jnp.diag(jnp.array([0.5, 2.0, -0.3, 3.0])).at[0, 1].set(9.0)
    assert [float(x) for x in multipliers(jnp.asarray(0.1), by)] == pytest.approx([3.0, 0.5])
    assert [float(x) for x in multipliers(jnp.asarray(0.0), by)] == pytest.approx([0.5, 0.5])
    assert np.isinf(multipliers(jnp.asarray(0.1), by * jnp.nan)[0])


def compared(answer, exact):
    """Name of the status, and relative error, of two motions (status, amplitude): smoothed and exact."""
    pairs = (answer, exact)
    of, other = ((Status.__names__.index(name), jnp.asarray(amplitude)) for name, amplitude in pairs)
    none = jnp.zeros(())
    judged = SteadyNumbers(of[1], none, of[0], 1, none, False, none, jnp.zeros(4), 0)
    status = jax.tree.unflatten(jax.tree.structure(Status.failed), [jnp.asarray(other[0])])
    angles, one = (none, other[1], *4 * (none,)), jnp.asarray(1)
    settled = Run(*angles, jnp.zeros(4), status, one, one)
    found = _compare(judged, settled)
    return str(names_of(found.status)), float(found.estimate)


@pytest.mark.parametrize(
    ("answer", "exact", "expected", "error"),
    [
        (("rocking", 0.104), ("rocking", 0.1), "rocking", 0.04),
        (("rocking", 0.106), ("rocking", 0.1), "inexact", 0.06),
        (("rocking", 0.1), ("sticking", 0.05), "inexact", 1.0),
        (("rocking", 0.1), ("rest", 0.0), "inexact", np.inf),
        (("rocking", 0.1), ("overturned", 0.7), "inexact", 1.0),
        (("rest", 0.0), ("rest", 0.0), "rest", 0.0),
        (("rest", 0.0), ("sticking", 0.01), "inexact", 1.0),
        (("overturned", np.inf), ("overturned", 0.7), "overturned", 0.0),
        (("overturned", np.inf), ("rocking", 0.1), "inexact", np.inf),
        # Of a motion that has not settled, the amplitude says nothing.
        (("rocking", 0.1), ("not_settled", 0.2), "rocking", np.nan),
        (("rocking", 0.1), ("event_bound", 0.2), "rocking", np.nan),
        # What the smoothed model does not claim to be an answer keeps its name.
        (("not_settled", 0.1), ("rocking", 0.2), "not_settled", 0.5),
        (("unstable", 0.1), ("rocking", 0.2), "unstable", 0.5),
    ],
)
def test_a_smoothed_result_far_from_the_linear_model_is_inexact(answer, exact, expected, error):
    status, found = compared(answer, exact)
    assert status == expected
    assert found == pytest.approx(error, rel=1e-12, nan_ok=True)
