"""Free symmetric rocking in closed form, held against the motion itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import differences
from tpd import Parameters, simulate
from tpd.theory import free_motion, one_harmonic_branches

NAMES = ("nu", "mu", "lam", "xi")
MOTIONS = (
    (0.2, 0.01, 1.0, 2.0),
    (0.2, 0.01, 0.1, 1.0),
    (0.25, 0.2, 0.8, 3.0),
    (0.3, 0.01, 0.05, 2.5),
    (0.15, 0.1, 2.0, 1.3),
)


def still(nu, mu, lam, xi):
    return Parameters(nu=nu, mu=mu, lam=lam, zeta=0.0, k=0.0, f=0.0, xi=xi)


SIZES = jax.jit(lambda x: jnp.stack(free_motion(still(*x))[:2]))


@pytest.mark.parametrize("xi", [0.4, 1.0, 2.0, 6.0])
def test_the_bare_block_has_the_closed_form(xi):
    found = free_motion(still(0.2, 0.0, 0.7, xi))
    assert float(found.amplitude) == pytest.approx(0.2 * (1 - 1 / np.cosh(np.pi / (2 * xi))), rel=1e-13)


@pytest.mark.parametrize("x", MOTIONS, ids=str)
def test_the_motion_comes_back_mirrored_and_then_as_it_was(x):
    p = still(*x)
    found = free_motion(p)
    assert found.exists
    start = np.array([found.amplitude, found.bob, 0.0, 0.0])
    seen = simulate(p, start, jnp.linspace(0.0, 1.0, 5) * p.period).ys
    np.testing.assert_allclose(seen[2], -start, atol=1e-12)
    np.testing.assert_allclose(seen[4], start, atol=1e-12)
    np.testing.assert_allclose(seen[1, :2], 0.0, atol=1e-12)


def test_what_is_said_not_to_exist_is_no_such_motion():
    """Above the frequency of the swinging mode the formula's block would start below its corner."""
    x = (0.2, 0.1, 0.4, 2.0)
    found = free_motion(still(*x))
    assert not found.exists
    start = np.array([found.amplitude, found.bob, 0.0, 0.0])
    p = still(*x)
    assert np.abs(simulate(p, start, jnp.array([0.0, float(p.period)])).ys[1] - start).max() > 0.01


def test_bob_and_block_resonate_at_odd_fractions_of_the_swinging_mode():
    """At one third of it the tilt jumps through infinity, which one harmonic alone does not see."""
    nu, mu, lam = 0.2, 0.01, 1.0
    rho = 0.75 / (1 + nu**2)
    mass = np.array([[1 + mu * rho * (4 + nu**2), -2 * mu * rho * lam], [-2 * rho, lam * rho]])
    squares = np.linalg.eigvals(np.linalg.solve(mass, np.diag([1 + 2 * mu, -1.0])))
    swinging = np.sqrt(-squares.min())
    for share in (1.0, 1 / 3, 1 / 5):
        low, high = (
            float(free_motion(still(nu, mu, lam, share * swinging * s)).amplitude) for s in (0.9999, 1.0001)
        )
        assert low * high < 0
        assert min(abs(low), abs(high)) > 2 * nu
    p = [
        Parameters(nu=nu, mu=mu, lam=lam, zeta=0.0, k=0.0, f=1e-9, xi=swinging * s / 3)
        for s in (0.9999, 1.0001)
    ]
    balance = [float(one_harmonic_branches(x).amplitude[0]) for x in p]
    assert balance[0] > 0.1
    np.testing.assert_allclose(*balance, rtol=1e-3)


def test_away_from_resonance_one_harmonic_is_a_few_per_cent_above():
    for xi in (2.0, 3.0, 5.0):
        hardly_pushed = Parameters(nu=0.2, mu=0.01, lam=1.0, zeta=0.0, k=0.0, f=1e-9, xi=xi)
        ratio = one_harmonic_branches(hardly_pushed).amplitude[0] / free_motion(hardly_pushed).amplitude
        assert 1.0 < float(ratio) < 1.06


@pytest.mark.parametrize("x", MOTIONS, ids=str)
def test_gradients_are_those_of_differences(x):
    slopes = jax.jit(jax.jacrev(SIZES))(jnp.array(x))
    for i, name in enumerate(NAMES):
        expected = differences(lambda x: np.asarray(SIZES(x)), x, i, share=1e-3)
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-8, atol=1e-10, err_msg=name)
