"""The plant of the linear equations: roots, projections and answers to a sine, against NumPy."""

import functools

import numpy as np
import pytest

from tests.exact.plants import plants_of, slopes_of
from tests.reference import differences, parameters
from tpd.theory.equations import Linear


@functools.cache
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


@functools.cache
def pencils():
    """M, C and K of every sample."""
    linears = [Linear(parameters(x)) for x in samples()]
    return [tuple(np.asarray(a) for a in (each.mass, each.damping, each.stiffness)) for each in linears]


def roots(x):
    """Rows of s1, s2 and the pair's p and q."""
    plants = plants_of(x)
    return np.stack([plants[name] for name in ("s1", "s2", "p", "q")], axis=-1)


def test_the_product_over_the_roots_is_the_determinant_of_the_pencil():
    for (mass, damping, stiffness), (s1, s2, p, q) in zip(pencils(), roots(samples()), strict=True):
        for s in (-1.3, 0.4, 2.0):
            product = np.linalg.det(mass) * (s - s1) * (s - s2) * (s**2 + p * s + q)
            pencil = s**2 * mass + s * damping + stiffness
            assert product == pytest.approx(np.linalg.det(pencil), rel=1e-10, abs=1e-12)


def test_one_root_is_positive_and_the_other_three_decay():
    s1, s2, p, q = roots(samples()).T
    assert np.all((s1 > 0) & (s2 < 0) & (q > 0) & (p >= -1e-15))
    assert np.all(p[samples()[:, 3] > 1e-3] > 0)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 2.5])
def test_the_roots_have_the_slopes_of_differences(zeta):
    x = np.array([0.25, 0.1, 0.7, zeta, 0.05, 0.3, 2.5])
    by = slopes_of(x)
    slopes = np.stack([by[name] for name in ("s1", "s2", "p", "q")])
    for i in range(4):
        if zeta > 0 or i != 3:
            expected = differences(lambda x: roots(x[None])[0], x, i, share=0.002)
            np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(slopes[:, 4:], 0.0)


def test_left_vectors_take_the_modes_apart():
    plants = plants_of(samples())
    shapes = {m: np.stack([plants[f"{m}{i}"] for i in range(4)], -1) for m in "ab"}
    lefts = {m: np.stack([plants[f"{m}l{i}"] for i in range(4)], -1) for m in "ab"}
    for m in "ab":
        for n in "ab":
            found = np.sum(lefts[m] * shapes[n], axis=1)
            np.testing.assert_allclose(found, 1.0 if m == n else 0.0, atol=1e-8)


def test_answers_to_a_sine_and_to_a_growing_one_solve_the_pencil():
    plants = plants_of(samples())
    for q, x, (mass, damping, stiffness) in zip(plants, samples(), pencils(), strict=True):
        s, f = 1j * x[6], x[5]
        pencil, slope = s**2 * mass + s * damping + stiffness, 2.0 * s * mass + damping
        expected = np.linalg.solve(pencil, f * np.array([stiffness[0, 0], 1.0]))
        lag = -np.linalg.solve(pencil, slope @ expected)
        for answer, name in ((expected, "{}_{}"), (lag, "{}_lag_{}")):
            for value, angle in zip(answer, ("tilt", "bob"), strict=True):
                found = [q[name.format(angle, of)] for of in ("sin", "cos")]
                np.testing.assert_allclose(found, [value.real, value.imag], rtol=1e-9, atol=1e-10)
