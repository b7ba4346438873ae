"""Multipliers of a symmetric orbit: roots of a quartic, the characteristic polynomial, and the map itself;
what remains of a disturbance."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.compiled.orbit_cases import chosen, felt
from tests.compiled.plants import entry
from tests.reference import UNSTABLE, along, parameters
from tpd.compiled import half_map_kernel
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of

store_roots, characteristic = entry(half_map_kernel.store_roots), entry(half_map_kernel.characteristic)
determinants = entry(half_map_kernel.determinants)


def roots(c):
    """Of a quartic, coefficients c1 to c4."""
    found = np.empty(4, complex)
    store_roots(tuple(map(float, c)), found)
    return found


def farthest(a, b):
    """The largest distance from a number in one set to the nearest in the other."""
    apart = np.abs(a[:, None] - b)
    return max(apart.min(axis=0).max(), apart.min(axis=1).max())


def test_roots_equal_those_of_numpy_and_form_conjugate_pairs():
    for row in np.random.default_rng(11).normal(size=(100, 4)) * [4.0, 6.0, 4.0, 1.0]:
        found, expected = roots(row), np.roots([1.0, *row])
        near = np.abs(expected[:, None] - expected)[~np.eye(4, dtype=bool)].min()
        reach = 1e-13 * np.abs(expected).max() / min(near, 1.0)
        assert farthest(found, expected) < reach
        assert farthest(found, found.conj()) < 2.0 * reach


@pytest.mark.parametrize(
    ("expected", "reach"),
    [
        ((0.5, 0.5, -0.3, 0.1), 1e-7),
        ((0.5, 0.5, 0.5, 0.1), 1e-4),
        ((0.7, 0.7, 0.7, 0.7), 1e-3),
        ((0.6 + 0.3j, 0.6 - 0.3j, 0.6 + 0.3j, 0.6 - 0.3j), 1e-6),
        ((-1.0, -1.0, 1.0, 1.0), 1e-6),
        ((0.0, 0.0, 0.0, 0.0), 1e-9),
        ((0.4, -0.9, 0.0, 0.0), 1e-6),
        ((1.0 + 1e-9, 0.3, 0.2 + 0.1j, 0.2 - 0.1j), 1e-14),
    ],
    ids=["double", "triple", "fourfold", "double pair", "two doubles", "zero", "no bob", "near unity"],
)
def test_a_root_of_order_m_has_an_error_of_the_mth_root_of_rounding(expected, reach):
    assert farthest(roots(np.poly(expected)[1:].real), np.array(expected)) < reach


def test_polynomial_and_determinants_follow_from_the_eigenvalues():
    for m in np.random.default_rng(13).normal(size=(50, 4, 4)):
        np.testing.assert_allclose(characteristic(m), np.poly(m)[1:], rtol=1e-11, atol=1e-12)
        g = np.linalg.eigvals(m)
        pairs = [g[i] * g[j] for i in range(4) for j in range(i)]
        expected = np.prod(1.0 - g), np.prod(1.0 + g), np.prod(1.0 - np.array(pairs))
        np.testing.assert_allclose(determinants(characteristic(m)), np.real(expected), rtol=1e-9, atol=1e-10)
        assert farthest(roots(characteristic(m)), g) < 1e-9 * np.abs(g).max()


def test_multipliers_equal_those_of_the_return_map_at_any_phase():
    for x, o in [*chosen(6, "rocking"), *chosen(4, "unstable")]:
        period, reach = 2.0 * np.pi / x[6], 1e-8 * np.abs(o.multipliers).max()
        ys, slopes, _ = along(x, o.state, np.array([0.0, 0.27, 1.0]) * period)
        later = along(x, ys[1], np.array([0.27, 1.27]) * period)[1]
        for by in (slopes[2], later[1]):
            assert farthest(o.multipliers, np.linalg.eigvals(felt(x, by))) < reach
        expected = np.linalg.det(np.eye(4) - felt(x, slopes[2]))
        assert o.fold * o.symmetry == pytest.approx(expected, rel=1e-9, abs=1e-10)


@jax.jit
def _map_at_turn(p, state, phase):
    """Derivative of the flow over a period from just after the upper turn, where friction has changed its
    sign. The distance of 1e-7 of a period changes the matrix by as much."""
    begin = phase / p.xi + 1e-7 * p.period
    at = tpd.simulate(p, state, jnp.stack([0.0 * begin, begin])).ys[-1]
    return jax.jacfwd(lambda y: tpd.simulate(p, y, jnp.stack([begin, begin + p.period])).ys[-1])(at)


REMAINING = {
    "friction": (0.25, 0.1, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0),
    "losses": (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.8),
    "both": (0.2, 0.1, 0.5, 0.2, 0.05, 0.3, 4.0, 0.9),
    "no bob": (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 0.95),
    "unstable": UNSTABLE[0],
}


@pytest.mark.parametrize("kappa", [2.0, 1.2])
@pytest.mark.parametrize("x", REMAINING.values(), ids=REMAINING)
def test_the_factor_of_settling_follows_from_powers_of_the_period_map(x, kappa):
    p = as_arrays(dataclasses.replace(parameters(x), kappa=kappa))
    o = tpd.symmetric_orbits(p)
    assert names_of(o.status)[0] == ("unstable" if x == UNSTABLE[0] else "rocking")
    by_period = felt(np.array(x), np.asarray(_map_at_turn(p, o.state[0], o.phase[0])))
    scale, size = np.array([1.0, float(p.xi)]), {}
    for n in (2, 4):
        block = np.linalg.matrix_power(by_period, n)[np.ix_([0, 2], [0, 2])] * scale / scale[:, None]
        # The mean square over all directions of a disturbance of length one.
        angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
        moved = block @ np.stack([np.cos(angles), np.sin(angles)])
        size[n] = np.sqrt(np.mean(np.sum(moved**2, axis=0))) ** (1.0 / n)
    assert float(o.remaining[0]) == pytest.approx(np.sqrt(size[2] * size[4]), rel=3e-6)
    # After many periods the factor is the largest modulus of a multiplier.
    largest = float(np.abs(o.multipliers[0]).max())
    many = np.linalg.norm(np.linalg.matrix_power(by_period, 64)[np.ix_([0, 2], [0, 2])]) ** (1.0 / 64)
    assert many == pytest.approx(largest, rel=0.06)
