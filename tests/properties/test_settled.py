"""What holds for every design: over the whole box of parameters and starts, and in its limits."""

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.properties.bounded import bounded
from tests.reference import WITH, named, orbits_of, parameters
from tests.reference import exact as solve
from tpd import Parameters, Status, simulate
from tpd.scene.status import SETTLED, names_of

BOX = ((0.03, 0.5), (0.0, 1.0), (0.02, 2.0), (0.0, 1.0), (0.0, 0.3), (0.0, 1.0), (0.3, 12.0), (0.0, 1.0))
"""Bounds of the parameters, in the order of `tests.reference.NAMES`."""
OTHERS = (
    *("overturned", "aperiodic", "not_settled", "unstable", "near_fold", "grazing", "event_bound", "held"),
    "neutral",
)
SAMPLES = 13

designs = st.tuples(*(st.floats(low, high) for low, high in BOX))
"""Hypothesis likes the ends of intervals: no mass, no damping, no friction, no shaking, no rebound."""
starts = st.tuples(*(st.floats(-0.3, 0.3) for _ in range(4)))


@bounded(60)
@given(designs, starts)
def test_every_result_is_finite_or_has_a_status_that_explains_it(x, y0):
    found = solve(x, y0)
    assert found.status in (*names_of(SETTLED), *OTHERS)
    sizes = np.array([found.amplitude, found.swing])
    assert not np.any(np.isnan(sizes))
    assert np.all(sizes >= 0)
    if found.status == "overturned":
        assert np.all(np.isinf(sizes))
    if found.status in names_of(SETTLED):
        # Under a resting block an undamped bob rings for ever, and one that hangs still is at a corner.
        undamped = found.status == "rest" and x[3] < 1e-12
        at_corner = found.status == "rest" and found.swing == 0.0
        assert np.all(np.isfinite(sizes))
        assert np.all(np.isfinite(found.steady.state))
        assert found.steady.multiplier < 1.0 or undamped
        assert np.all(np.isfinite(found.slopes[0]))
        assert np.all(np.isfinite(found.slopes[1])) or undamped or at_corner
    else:
        assert np.all(np.isnan(found.slopes))


@jax.jit
def _moved(x, y0, times):
    motion = simulate(parameters(x), y0, times)
    return motion.ys, motion.status


def motions(x, y0, begin):
    period = 2.0 * np.pi / x[6]
    # A block about to topple doubles every difference in about 0.7: not for longer than rounding allows.
    times = begin * period + np.linspace(0.0, min(2.0 * period, 12.0), SAMPLES)
    ys, status = _moved(np.array(x), np.array(y0), times)
    return np.asarray(ys), status


def assert_same(a, b, x):
    """Up to rounding, and what two periods make of it: a motion that grows takes it along."""
    (ys, status), (other, same) = a, b
    assert status == same
    np.testing.assert_array_equal(np.isnan(ys), np.isnan(other))
    size = np.nanmax(np.abs(ys)) + x[0]
    assert np.nanmax(np.abs(ys - other)) < 1e-7 * size


@bounded(60)
@given(designs, starts, st.integers(1, 9))
def test_mirrored_forcing_and_a_shift_by_whole_periods_give_the_same_motion(x, y0, periods):
    motion = motions(x, y0, 0.0)
    assert_same(motion, motions(x, y0, float(periods)), x)
    ys, status = motions(x, -np.array(y0), 0.5)
    assert_same(motion, (-ys, status), x)


def test_orbits_do_not_depend_on_order_or_size_of_their_batch():
    rng = np.random.default_rng(4)
    x = np.array([WITH[i % 4].x for i in range(400)]) * rng.uniform(0.95, 1.05, (400, 7))
    x[:, 0] = np.minimum(x[:, 0], 0.5)
    order = rng.permutation(len(x))

    def orbits(x):
        return jax.tree.leaves(orbits_of(parameters(list(x.T))))

    for one, mixed, few in zip(orbits(x), orbits(x[order]), orbits(x[:5]), strict=True):
        np.testing.assert_array_equal(one[order], mixed)
        np.testing.assert_array_equal(one[:5], few)


@pytest.mark.parametrize("case", WITH[:3], ids=named)
def test_a_bob_without_mass_is_the_limit_of_light_bobs(case):
    without, *light = (solve([case.x[0], mu, *case.x[2:]]).amplitude for mu in (0.0, 1e-3, 1e-4, 1e-5))
    apart = [abs(amplitude - without) for amplitude in light]
    # To first order in the mass.
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.05)
    assert apart[1] / apart[2] == pytest.approx(10.0, rel=0.05)


def test_a_bob_on_a_short_rod_acts_as_a_mass_at_the_hinge():
    # As lam -> 0 the bob hangs still below its hinge, and
    #     (1 + mu rho (4 + nu^2)) phi'' = (1 + 2 mu) (phi - f sin) - s (1 + mu) nu - sigma k,
    # a bare block in its own time.
    nu, mu, zeta, k, f, xi = 0.25, 0.1, 0.7, 0.05, 0.377, 2.67
    rho = 0.75 / (1.0 + nu**2)
    inertia, weight = 1.0 + mu * rho * (4.0 + nu**2), 1.0 + 2.0 * mu
    without = Parameters(
        nu=(1.0 + mu) / weight * nu,
        mu=0.0,
        lam=1.0,
        zeta=0.1,
        k=k / weight,
        f=f,
        xi=xi * np.sqrt(inertia / weight),
        rho=rho,
    )
    limit = largest(without)
    apart = [
        abs(largest(parameters((nu, mu, lam, zeta, k, f, xi))) / limit - 1.0)
        for lam in (1e-2, 1e-3, 1e-4, 1e-6)
    ]
    assert limit == pytest.approx(0.0756, abs=1e-4)
    assert apart[0] < 0.01
    for longer, shorter, ratio in zip(apart[:-1], apart[1:], (10.0, 10.0, 100.0), strict=True):
        assert longer / shorter == pytest.approx(ratio, rel=0.1)


def largest(p):
    """Amplitude of the one orbit, which attracts."""
    orbits = orbits_of(p)
    assert (orbits.status == Status.rocking)[0]
    return float(orbits.amplitude[0])
