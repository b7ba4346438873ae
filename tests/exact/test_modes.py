"""Modes and arcs in closed form, against eigenvalues, matrix exponentials and differences."""

import functools

import numba
import numpy as np
import pytest
from scipy.linalg import block_diag, expm

from tests.exact.plants import plants_of, slopes_of
from tests.reference import differences, parameters
from tpd.exact.arcs import Load, exponential, instant, launch, pair, state_at, turned
from tpd.exact.plant import STEP
from tpd.exact.terms import REST, SLIP, STICK
from tpd.theory.equations import Linear


@functools.cache
def samples():
    """Parameters from everywhere, and from each corner where the algebra changes its kind."""
    rng = np.random.default_rng(1)
    low, high = [0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.5], [0.5, 2.0, 1.9, 3.0, 0.1, 1.0, 6.0]
    inside = rng.uniform(low, high, size=(60, 7))
    corners = [
        (0.25, mu, lam, zeta, 0.05, 0.3, 2.5)
        for mu in (0.0, 1e-9, 0.05, 2.0)
        for lam in (0.05, 0.8, 1.9, 2.0)
        for zeta in (0.0, 1e-8, 0.1, 0.999, 1.0, 1.001, 3.0)
    ]
    return np.concatenate([inside, corners])


@functools.cache
def pencils():
    """M, C and K of every sample."""
    linears = [Linear(parameters(x)) for x in samples()]
    return [tuple(np.asarray(a) for a in (each.mass, each.damping, each.stiffness)) for each in linears]


@functools.cache
def quartics():
    """Coefficients of det(M s^2 + C s + K), the highest power first, of every sample."""

    def entry(matrices, i, j):
        return [matrix[i, j] for matrix in matrices]

    return [
        np.polysub(np.polymul(entry(m, 0, 0), entry(m, 1, 1)), np.polymul(entry(m, 0, 1), entry(m, 1, 0)))
        for m in pencils()
    ]


def roots(x):
    """Rows of s1, s2 and the pair's p and q."""
    plants = plants_of(x)
    return np.stack([plants[name] for name in ("s1", "s2", "p", "q")], axis=-1)


def state_matrix(p):
    linear = Linear(p)
    inverse = np.linalg.inv(linear.mass)
    lower = np.hstack([-inverse @ linear.stiffness, -inverse @ linear.damping])
    return np.vstack([np.eye(4)[2:], lower])


def test_the_product_over_the_roots_is_the_determinant_of_the_pencil():
    for (mass, damping, stiffness), (s1, s2, p, q) in zip(pencils(), roots(samples()), strict=True):
        for s in (-1.3, 0.4, 2.0):
            product = np.linalg.det(mass) * (s - s1) * (s - s2) * (s**2 + p * s + q)
            pencil = s**2 * mass + s * damping + stiffness
            assert product == pytest.approx(np.linalg.det(pencil), rel=1e-10, abs=1e-12)


def test_the_roots_multiply_out_to_the_quartic():
    for (a4, *rest), (s1, s2, p, q) in zip(quartics(), roots(samples()), strict=True):
        product = a4 * np.polymul(np.poly([s1, s2]), [1.0, p, q])
        np.testing.assert_allclose(product[1:], rest, rtol=1e-12, atol=1e-13 * np.abs(rest).max())


def test_the_roots_are_those_of_numpy():
    for polynomial, (s1, s2, p, q) in zip(quartics(), roots(samples()), strict=True):
        expected, ours = np.roots(polynomial), np.array([s1, s2, *np.roots([1.0, p, q])])
        gaps = np.abs(ours[:, None] - expected)
        # Double roots (critical damping) are known to the square root of round-off.
        assert gaps.min(axis=1).max() < 1e-6 * np.abs(expected).max()
        assert gaps.min(axis=0).max() < 1e-6 * np.abs(expected).max()


def test_one_root_is_positive_and_the_other_three_decay():
    s1, s2, p, q = roots(samples()).T
    assert np.all(s1 > 0)
    assert np.all(s2 < 0)
    assert np.all(q > 0)
    assert np.all(p >= -1e-15)
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


PAIRS = [
    (0.0, 4.0),
    (0.3, 4.0),
    (12.0, 4.0),
    (40.0, 5.0),
    *((2.0, 1.0 + d) for d in (-1e-3, -1e-6, 0.0, 1e-6, 1e-3)),
]


@numba.njit
def pair_of(p, q, t):
    return pair(p, q, t)


@pytest.mark.parametrize(("p", "q"), PAIRS)
@pytest.mark.parametrize("t", [0.0, 1e-6, 0.03, 1.0, 8.0])
def test_the_pair_solves_its_equation_through_critical_damping(p, q, t):
    expected = expm(np.array([[0.0, 1.0], [-q, -p]]) * t)[0]
    np.testing.assert_allclose(pair_of(p, q, t), expected, rtol=1e-11, atol=1e-14)


@numba.njit
def functions(x):
    return exponential(x), *turned(x)


@pytest.mark.parametrize("x", [-300.0, -0.3, 0.0, 1e-20, 2.0, 600.0])
def test_an_exponential_and_a_turn_carry_their_derivatives(x):
    found = np.array(functions(complex(x, 3.0 * STEP)))
    expected = np.array([np.exp(x), np.sin(x), np.cos(x)])
    np.testing.assert_allclose(found.real, expected, rtol=1e-15)
    np.testing.assert_allclose(found.imag / (3.0 * STEP), expected[[0, 2, 1]] * [1.0, 1.0, -1.0], rtol=1e-15)


@numba.njit
def arc(plants, mode, y, load, t):
    """The state at time `t` on an arc that leaves `y` at time zero, in closed form."""
    kind, tilt, way = mode
    a = launch(plants[0], kind, tilt, way, y[0], y[1], y[2], y[3], load)
    return state_at(a, instant(a, t), t)


def by_exponential(x, mode, y, load, t):
    """The same from one matrix exponential of state, constant load and forcing together."""
    p, (kind, tilt, way) = parameters(x), mode
    linear = Linear(p)
    own, forced, constant = np.zeros((4, 4)), np.zeros((4, 1)), np.zeros((4, 1))
    if kind == SLIP:
        own = state_matrix(p)
        constant[2:, 0] = np.linalg.solve(linear.mass, [-tilt * linear.weight - way * linear.friction, 0.0])
        forced[2:, 0] = np.linalg.solve(linear.mass, [-p.f * linear.tilt, p.f])
    else:
        own[1, 3] = 1.0
        own[3, [1, 3]] = -1.0 / linear.m22, -float(p.hinge) / linear.m22
        forced[3, 0] = p.f / linear.m22
    if load.xi:
        # sin, cos, t sin and t cos of phase + xi t.
        turning = load.xi * np.array([[0.0, 1.0], [-1.0, 0.0]])
        functions, eta = block_diag(turning, turning), [load.e0, 0.0, load.e1, 0.0]
        functions[2, 0] = functions[3, 1] = 1.0
        start = [np.sin(load.phase), np.cos(load.phase), 0.0, 0.0]
    else:
        # 1, t, t^2 and t^3.
        functions, eta, start = np.diag([1.0, 2.0, 3.0], -1), load[2:], [1.0, 0.0, 0.0, 0.0]
    big = block_diag(own, functions, 0.0)
    big[:4, 4:8], big[:4, 8:] = forced * eta, constant
    return (expm(big * t) @ np.concatenate([y, start, [1.0]]))[:4]


LOADS = {
    "steady": Load(2.5, 0.8, 1.0, 0.0, 0.0, 0.0),
    "growing": Load(2.5, 0.8, 0.3, 0.2, 0.0, 0.0),
    "cubic": Load(0.0, 0.0, 0.4, -0.9, 0.5, 0.3),
}


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("kind", [SLIP, STICK, REST])
@pytest.mark.parametrize("mu", [0.0, 1e-9, 0.2])
@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0, 2.5])
def test_an_arc_is_the_matrix_exponential(load, kind, mu, zeta):
    x = np.array([0.25, mu, 0.7, zeta, 0.05, 0.3, 2.5])
    y = np.array([0.0 if kind == REST else 0.1, -0.2, 0.3 if kind == SLIP else 0.0, 0.4])
    plants = plants_of(x[None])
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):
        for t in (0.0, 0.4, 2.0):
            mode = (kind, *signs)
            expected = by_exponential(x, mode, y, load, t)
            found = arc(plants, mode, y, load, t)
            np.testing.assert_allclose(found[:4], expected, rtol=1e-8, atol=1e-9, err_msg=f"{signs}, t = {t}")
