"""Multipliers in closed form: roots of a quartic, against NumPy."""

import jax
import mpmath
import numpy as np
import pytest

from tpd.core.eigenvalues import quartic_roots


@jax.jit
@jax.vmap
def _roots(c):
    return quartic_roots(tuple(c))


def roots(c):
    """Of one or many quartics, coefficients c1 to c4."""
    real, imag = _roots(np.atleast_2d(np.asarray(c, dtype=float)))
    return np.asarray(real) + 1j * np.asarray(imag)


def farthest(a, b):
    """The largest distance from a number in one set to the nearest in the other."""
    apart = np.abs(a[:, None] - b)
    return max(apart.min(axis=0).max(), apart.min(axis=1).max())


def test_roots_are_those_of_numpy():
    c = np.random.default_rng(11).normal(size=(500, 4)) * [4.0, 6.0, 4.0, 1.0]
    for found, row in zip(roots(c), c, strict=True):
        expected = np.roots([1.0, *row])
        near = np.abs(expected[:, None] - expected)[~np.eye(4, dtype=bool)].min()
        assert farthest(found, expected) < 1e-13 * np.abs(expected).max() / min(near, 1.0)


def test_roots_come_in_conjugate_pairs():
    c = np.random.default_rng(12).normal(size=(500, 4))
    for found in roots(c):
        assert farthest(found, found.conj()) < 1e-12


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
    ],
    ids=["double", "triple", "fourfold", "double pair", "two doubles", "zero", "no bob"],
)
def test_a_root_of_order_m_is_known_to_the_mth_root_of_rounding(expected, reach):
    assert farthest(roots(np.poly(expected)[1:].real)[0], np.array(expected)) < reach


@pytest.mark.parametrize("spread", [1e2, 1e4, 1e6, 1e8])
def test_roots_of_very_different_size_are_each_known(spread):
    for signs in ((1, 1, 1, 1), (1, -1, 1, -1), (-1, 1, 1, 1)):
        expected = np.array(signs) * np.array([1.7, 0.9 / spread**0.3, 0.6 / spread**0.7, 0.8 / spread])
        with mpmath.workdps(40):
            c = [1]
            for r in expected:
                c = [a - mpmath.mpf(float(r)) * b for a, b in zip([*c, 0], [0, *c], strict=True)]
            c = np.array([float(v) for v in c[1:]])
        found = roots(c)[0]
        # The small ones feel the rounding of the coefficients, each of its own size.
        for r in expected:
            assert np.abs(found - r).min() < 1e-10 * abs(r)


def test_a_multiplier_of_twice_unity_is_not_missed():
    for largest in (1.0 + 1e-9, 1.0 - 1e-9, 40.0):
        found = roots(np.poly([largest, 0.3, 0.2 + 0.1j, 0.2 - 0.1j])[1:].real)[0]
        assert np.abs(found).max() == pytest.approx(largest, rel=1e-14)
