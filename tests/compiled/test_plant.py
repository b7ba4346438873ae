"""The plant of the linear model: roots with their slopes, against NumPy."""

import numpy as np
import pytest

from tests.compiled.plants import plants_of, slopes_of
from tests.reference import differences, matrices, parameters
from tpd.theory.equations import Linear


def samples():
    """Parameters from everywhere, and from each corner where the algebra changes its kind."""
    rng = np.random.default_rng(1)
    low, high = [0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.5], [0.5, 2.0, 1.9, 3.0, 0.1, 1.0, 6.0]
    corners = [
        (0.25, mu, lam, zeta, 0.05, 0.3, 2.5)
        for mu in (0.0, 1e-9, 0.05, 2.0)
        for lam in (0.05, 0.8, 2.0)
        for zeta in (0.0, 1e-8, 0.1, 0.999, 1.0, 1.001, 3.0)
    ]
    return np.concatenate([rng.uniform(low, high, size=(30, 7)), corners])


def roots(x):
    """Rows of s1, s2 and the pair's p and q."""
    plants = plants_of(x)
    return np.stack([plants[name] for name in ("s1", "s2", "p", "q")], axis=-1)


def test_the_product_over_the_roots_equals_the_determinant_of_the_equations():
    for x, (s1, s2, p, q) in zip(samples(), roots(samples()), strict=True):
        mass, damping, stiffness = matrices(Linear(parameters(x)))
        for s in (-1.3, 0.4, 2.0):
            product = np.linalg.det(mass) * (s - s1) * (s - s2) * (s**2 + p * s + q)
            pencil = s**2 * mass + s * damping + stiffness
            assert product == pytest.approx(np.linalg.det(pencil), rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 2.5])
def test_derivatives_of_the_roots_equal_finite_differences(zeta):
    x = np.array([0.25, 0.1, 0.7, zeta, 0.05, 0.3, 2.5])
    by = slopes_of(x)
    slopes = np.stack([by[name] for name in ("s1", "s2", "p", "q")])
    for i in range(4):
        if zeta > 0 or i != 3:
            expected = differences(lambda x: roots(x[None])[0], x, i, share=0.002)
            np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(slopes[:, 4:], 0.0)
