"""The friction that loses as much as impacts do, against the exact free motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Parameters, simulate
from tpd.theory import equivalent_friction

CASES = {"bare": (0.0, 1.0), "long rod": (0.2, 1e5)}
"""mu and lam: a bob on a long rod stays where it is and takes no energy."""


def block(mu, lam, phi, **losses):
    scene = {"nu": 0.2, "mu": mu, "lam": lam, "zeta": 0.0, "f": 0.0, "xi": 1.0, "k": 0.0}
    return Parameters(**{**scene, **losses}), np.array([phi, 0.0, 0.0, 0.0])


_followed = jax.jit(lambda p, y0, times: simulate(p, y0, times).ys[-1])


def lost(mu, lam, phi, **losses):
    """Energy that the free block has lost after the time of one cycle without losses."""
    p, y0 = block(mu, lam, phi, **losses)
    inertia, weight, tilt = 1 + mu * p.inertia_ratio * p.nu**2, (1 + mu) * p.nu, 1 + 2 * mu
    period = 4 * np.sqrt(inertia / tilt) * np.arccosh(1 / (1 - tilt * phi / weight))
    y = _followed(jax.tree.map(jnp.asarray, p), y0, np.array([0.0, period]))

    def energy(y):
        return inertia * y[2] ** 2 / 2 + weight * abs(y[0]) - tilt * y[0] ** 2 / 2

    return energy(y0) - float(energy(y))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("phi", [0.02, 0.1])
def test_it_takes_from_a_free_cycle_what_the_impacts_take(case, phi):
    mu, lam = CASES[case]
    apart = []
    for e in (0.996, 0.998, 0.999):
        k = float(equivalent_friction(block(mu, lam, phi, e=e)[0], phi))
        apart.append(lost(mu, lam, phi, k=k) / lost(mu, lam, phi, e=e) - 1)
    assert abs(apart[-1]) < 0.01
    # What the losses do to one another is of second order.
    np.testing.assert_allclose(np.array(apart[:-1]) / apart[1:], 2.0, atol=0.1)


def test_the_bare_block_s_is_the_closed_form_and_none_without_impact_loss():
    p = Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.1, k=0.05, f=0.1, xi=2.0, e=0.9)
    assert float(equivalent_friction(p, 0.1)) == pytest.approx((1 - 0.9**2) * (2 * 0.2 - 0.1) / 4, rel=1e-14)
    assert float(equivalent_friction(block(0.1, 0.5, 0.0)[0], 0.1)) == 0.0


def test_arrays_and_derivatives():
    p, _ = block(0.1, 0.5, 0.0, e=0.9)
    phi = np.array([0.0, 0.1, 0.2])
    found = equivalent_friction(p, phi)
    np.testing.assert_allclose(found, 0.19 * (0.44 - 1.2 * phi) / 4, rtol=1e-14)
    batched = Parameters(**{**vars(p), "e": np.array([0.7, 0.8, 0.9])})
    np.testing.assert_allclose(equivalent_friction(batched, 0.1)[2], found[1], rtol=1e-14)
    slope = jax.jit(jax.grad(lambda p, x: equivalent_friction(p, x), argnums=(0, 1)))
    by_p, by_phi = slope(jax.tree.map(jnp.asarray, p), 0.1)
    assert float(by_phi) == pytest.approx(-0.19 * 1.2 / 4, rel=1e-12)
    assert float(by_p.e) == pytest.approx(-2 * 0.9 * (0.44 - 0.12) / 4, rel=1e-12)
    assert float(by_p.nu) == pytest.approx(0.19 * 2.2 / 4, rel=1e-12)


@pytest.mark.parametrize(
    ("amplitude", "match"),
    [
        (-0.1, "`amplitude` must be zero or positive, and finite, but is -0.1"),
        (np.nan, "`amplitude` must be zero or positive, and finite, but is nan"),
        (np.array([0.1, 0.5]), r"`amplitude` must be at most 0\.4, twice the tilt .* but is 0\.5"),
    ],
)
def test_amplitudes_out_of_range_are_refused(amplitude, match):
    with pytest.raises(ValueError, match=match):
        equivalent_friction(block(0.0, 1.0, 0.0, e=0.9)[0], amplitude)
