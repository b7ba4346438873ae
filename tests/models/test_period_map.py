"""Periodic orbits as fixed points of a map: Newton's method, multipliers and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import WITH, differences, parameters, smoothed
from tpd import Smoothed
from tpd.compiled.rows import packed
from tpd.models.period_map import Orbit, implicit, is_rocking, multipliers, refine
from tpd.scene.parameters import from_row
from tpd.scene.status import index_of

CASE = WITH[0]


@jax.jit
def refined(x):
    """Return the orbit of the smoothed model from the rough end of a short motion."""
    p = from_row(packed(parameters(x).numbers))
    model = Smoothed(tolerance=1e-3, max_periods=60, cycle_rtol=1e-11)
    return refine(p, model, model.settle(p, jnp.zeros(4)), index_of("rocking"))


@pytest.fixture(scope="module")
def orbit():
    return refined(np.array(CASE.x))


def test_newtons_method_closes_an_orbit_from_a_rough_guess(orbit):
    assert float(orbit.residual) < 1e-8
    np.testing.assert_allclose(orbit.end, orbit.y, rtol=0, atol=1e-8)
    assert float(orbit.sizes[0]) == pytest.approx(CASE.amplitude, rel=1e-3)
    assert bool(orbit.closed)


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


def test_an_orbit_that_is_not_closed_has_a_larger_error():
    none = jnp.zeros((6, 9))
    one, other = (
        Orbit(none[0, :4], 1e-12, none[0, :4], none[0, :2], none, none[:, :4], 1.0, 0.0, jnp.asarray(closed))
        for closed in (True, False)
    )
    assert float(one.error) == 1e-12 < float(other.error)


def test_only_rocking_and_sticking_motions_count_as_rocking():
    found = [bool(is_rocking(index_of(name))) for name in ("rocking", "sticking", "rest", "unstable")]
    assert found == [True, True, False, False]
