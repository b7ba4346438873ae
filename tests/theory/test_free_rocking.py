"""Free rocking in closed form against the motion itself, and the friction that loses as much as impacts."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import differences
from tpd import Parameters, simulate
from tpd.theory import equivalent_friction, free_motion, one_harmonic_branches, turning_tilts

NAMES = ("nu", "mu", "lam", "xi")
MOTIONS = (0.2, 0.01, 1.0, 2.0), (0.25, 0.2, 0.8, 3.0), (0.3, 0.01, 0.05, 2.5), (0.15, 0.1, 2.0, 1.3)


def still(nu, mu, lam, xi):
    return Parameters(nu=nu, mu=mu, lam=lam, zeta=0.0, k=0.0, f=0.0, xi=xi)


SIZES = jax.jit(lambda x: jnp.stack(free_motion(still(*x))[:2]))


def test_free_rocking_without_pendulum_has_the_closed_form():
    for xi in (0.4, 1.0, 2.0, 6.0):
        expected = 0.2 * (1 - 1 / np.cosh(np.pi / (2 * xi)))
        amplitude = float(free_motion(still(0.2, 0.0, 0.7, xi)).amplitude)
        assert amplitude == pytest.approx(expected, rel=1e-13)
        pushed = one_harmonic_branches(dataclasses.replace(still(0.2, 0.0, 0.7, xi), f=1e-9))
        assert xi < 2.0 or 1.0 < float(pushed.amplitude[0]) / amplitude < 1.06


@pytest.mark.parametrize("x", MOTIONS, ids=str)
def test_free_rocking_is_mirrored_after_half_a_period(x):
    p = still(*x)
    found = free_motion(p)
    assert found.exists
    start = np.array([found.amplitude, found.bob, 0.0, 0.0])
    seen = simulate(p, start, jnp.linspace(0.0, 1.0, 5) * p.period).ys
    # Block and bob turn at the same instant, at which also one call of the compiled code ends.
    np.testing.assert_allclose(seen[2], -start, atol=2e-13)
    np.testing.assert_allclose(seen[4], start, atol=2e-13)
    np.testing.assert_allclose(seen[1, :2], 0.0, atol=1e-12)
    # Above the frequency of the swinging mode the block of the formula would start below its corner.
    assert not free_motion(still(0.2, 0.1, 0.4, 2.0)).exists


@pytest.mark.parametrize("x", MOTIONS, ids=str)
def test_gradients_of_free_rocking_equal_finite_differences(x):
    slopes = jax.jit(jax.jacrev(SIZES))(jnp.array(x))
    for i, name in enumerate(NAMES):
        expected = differences(lambda x: np.asarray(SIZES(x)), x, i, share=1e-3)
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-8, atol=1e-10, err_msg=name)


CASES = {"bare": (0.0, 1.0), "long rod": (0.2, 1e5)}
"""mu and lam: a bob on a long rod stays where it is and takes no energy."""


def struck(mu, lam, phi, **losses):
    scene = {"nu": 0.2, "mu": mu, "lam": lam, "zeta": 0.0, "f": 0.0, "xi": 1.0, "k": 0.0}
    return Parameters(**{**scene, **losses}), np.array([phi, 0.0, 0.0, 0.0])


_followed = jax.jit(lambda p, y0, times: simulate(p, y0, times).ys[-1])


def lost(mu, lam, phi, **losses):
    """Energy that the free block has lost after the time of one cycle without losses."""
    p, y0 = struck(mu, lam, phi, **losses)
    inertia, weight, tilt = 1 + mu * p.inertia_ratio * p.nu**2, (1 + mu) * p.nu, 1 + 2 * mu
    period = 4 * np.sqrt(inertia / tilt) * np.arccosh(1 / (1 - tilt * phi / weight))
    y = _followed(jax.tree.map(jnp.asarray, p), y0, np.array([0.0, period]))

    def energy(y):
        return inertia * y[2] ** 2 / 2 + weight * abs(y[0]) - tilt * y[0] ** 2 / 2

    return energy(y0) - float(energy(y))


@pytest.mark.parametrize(("case", "phi"), [("bare", 0.1), ("long rod", 0.02)])
def test_the_equivalent_friction_loses_the_energy_of_the_impacts_of_a_cycle(case, phi):
    mu, lam = CASES[case]
    apart = []
    for e in (0.996, 0.998, 0.999):
        k = float(equivalent_friction(struck(mu, lam, phi, e=e)[0], phi))
        apart.append(lost(mu, lam, phi, k=k) / lost(mu, lam, phi, e=e) - 1)
    assert abs(apart[-1]) < 0.01
    # What the losses do to one another is of second order.
    np.testing.assert_allclose(np.array(apart[:-1]) / apart[1:], 2.0, atol=0.1)


def test_the_equivalent_friction_has_a_closed_form_accepts_arrays_and_is_differentiable():
    p, phi = struck(0.1, 0.5, 0.0, e=0.9)[0], np.array([0.0, 0.1, 0.2])
    bare = dataclasses.replace(p, mu=0.0)
    np.testing.assert_allclose(equivalent_friction(bare, phi), (1 - 0.9**2) * (2 * 0.2 - phi) / 4, rtol=1e-14)
    assert float(equivalent_friction(struck(0.1, 0.5, 0.0)[0], 0.1)) == 0.0
    found = equivalent_friction(p, phi)
    np.testing.assert_allclose(found, 0.19 * (0.44 - 1.2 * phi) / 4, rtol=1e-14)
    batched = dataclasses.replace(p, e=np.array([0.7, 0.8, 0.9]))
    np.testing.assert_allclose(equivalent_friction(batched, 0.1)[2], found[1], rtol=1e-14)
    by_p, by_phi = jax.jit(jax.grad(equivalent_friction, argnums=(0, 1)))(jax.tree.map(jnp.asarray, p), 0.1)
    assert float(by_phi) == pytest.approx(-0.19 * 1.2 / 4, rel=1e-12)
    assert float(by_p.e) == pytest.approx(-2 * 0.9 * (0.44 - 0.12) / 4, rel=1e-12)
    assert float(by_p.nu) == pytest.approx(0.19 * 2.2 / 4, rel=1e-12)


def test_turning_tilts_of_free_rocking_equal_the_linear_model():
    p = Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.0, k=0.02, f=0.0, xi=1.0, e=0.95)
    tilts, times = turning_tilts(0.2, 0.02, 0.95, 0.1, 4)
    seen = np.asarray(simulate(p, np.array([0.1, 0.0, 0.0, 0.0]), times).ys)
    np.testing.assert_allclose(np.abs(seen[:, 0]), tilts, rtol=1e-9)
    np.testing.assert_allclose(seen[:, 2], 0.0, atol=1e-9)
    bare = struck(0.0, 1.0, 0.0, e=0.9)[0]
    for call, match in (
        (lambda: turning_tilts(0.2, 0.02, 0.95, 0.2, 1), "`tilt` must be between 0 and 0.18, but is 0.2"),
        (
            lambda: equivalent_friction(bare, -0.1),
            "`amplitude` must be zero or positive, and finite, but is -0.1",
        ),
        (
            lambda: equivalent_friction(bare, np.array([0.1, 0.5])),
            r"at most 0\.4, twice the tilt .* but is 0\.5",
        ),
    ):
        with pytest.raises(ValueError, match=match):
            call()
