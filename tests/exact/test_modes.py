"""The modes in closed form, against eigenvalues, matrix exponentials and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from tpd.exact.arc import launch

from tests.reference import differences, parameters
from tpd.core.equations import Linear
from tpd.exact.contact import REST, SLIP, STICK, Mode
from tpd.exact.modes import Plant, Rates, quartic, roots

ALL_ROOTS = jax.jit(jax.vmap(lambda x: jnp.stack(roots(parameters(x)))))
ALL_QUARTICS = jax.jit(jax.vmap(lambda x: jnp.stack(quartic(parameters(x)))))
PAIR = jax.jit(lambda p, q, t: jnp.stack(Rates(0.9, -1.1, p, q, 2.5).pair(t)))


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


def state_matrix(p):
    linear = Linear(p)
    inverse = np.linalg.inv(linear.mass)
    lower = np.hstack([-inverse @ linear.stiffness, -inverse @ linear.damping])
    return np.vstack([np.eye(4)[2:], lower])


def test_the_quartic_is_the_determinant_of_the_pencil():
    for x, coefficients in zip(samples(), np.asarray(ALL_QUARTICS(samples())), strict=True):
        linear = Linear(parameters(x))
        for s in (-1.3, 0.4, 2.0):
            pencil = s**2 * linear.mass + s * linear.damping + linear.stiffness
            assert np.polyval(coefficients, s) == pytest.approx(np.linalg.det(pencil), rel=1e-10, abs=1e-12)


def test_the_roots_multiply_out_to_the_quartic():
    coefficients, found = np.asarray(ALL_QUARTICS(samples())), np.asarray(ALL_ROOTS(samples()))
    for (a4, *rest), (s1, s2, p, q) in zip(coefficients, found, strict=True):
        product = a4 * np.polymul(np.poly([s1, s2]), [1.0, p, q])
        np.testing.assert_allclose(product[1:], rest, rtol=1e-12, atol=1e-13 * np.abs(rest).max())


def test_the_roots_are_those_of_numpy():
    coefficients, found = np.asarray(ALL_QUARTICS(samples())), np.asarray(ALL_ROOTS(samples()))
    for polynomial, (s1, s2, p, q) in zip(coefficients, found, strict=True):
        expected, ours = np.roots(polynomial), np.array([s1, s2, *np.roots([1.0, p, q])])
        gaps = np.abs(ours[:, None] - expected)
        # Double roots (critical damping) are known to the square root of round-off.
        assert gaps.min(axis=1).max() < 1e-6 * np.abs(expected).max()
        assert gaps.min(axis=0).max() < 1e-6 * np.abs(expected).max()


def test_one_root_is_positive_and_the_other_three_decay():
    s1, s2, p, q = np.asarray(ALL_ROOTS(samples())).T
    assert np.all(s1 > 0)
    assert np.all(s2 < 0)
    assert np.all(q > 0)
    assert np.all(p >= -1e-15)
    assert np.all(p[samples()[:, 3] > 1e-3] > 0)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 2.5])
def test_the_roots_have_the_slopes_of_differences(zeta):
    x = np.array([0.25, 0.1, 0.7, zeta, 0.05, 0.3, 2.5])
    slopes = SLOPES(x)
    for i in range(4):
        if zeta > 0 or i != 3:
            expected = differences(lambda x: np.asarray(ALL_ROOTS(x[None]))[0], x, i, share=0.002)
            np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(slopes[:, 4:], 0.0)


SLOPES = jax.jit(jax.jacfwd(lambda x: jnp.stack(roots(parameters(x)))))

PAIRS = [
    (0.0, 4.0),
    (0.3, 4.0),
    (12.0, 4.0),
    (40.0, 5.0),
    *((2.0, 1.0 + d) for d in (-1e-3, -1e-6, 0.0, 1e-6, 1e-3)),
]


@pytest.mark.parametrize(("p", "q"), PAIRS)
@pytest.mark.parametrize("t", [0.0, 1e-6, 0.03, 1.0, 8.0])
def test_the_pair_solves_its_equation_through_critical_damping(p, q, t):
    expected = expm(np.array([[0.0, 1.0], [-q, -p]]) * t)[0]
    np.testing.assert_allclose(PAIR(p, q, t), expected, rtol=1e-11, atol=1e-14)


@jax.jit
def arc(x, kind, signs, y, phase, t):
    """The state at time `t` on an arc that leaves `y` at time zero, in closed form."""
    a = launch(Plant(parameters(x)), Mode(kind, signs[0], signs[1]), y, jnp.asarray(phase))
    return jnp.stack(a.state(a.at(jnp.asarray(t)), jnp.zeros(())))


def by_exponential(x, kind, signs, y, phase, t):
    """The same from one matrix exponential of state, constant load and forcing together."""
    p = parameters(x)
    linear, big = Linear(p), np.zeros((7, 7))
    load = np.zeros((2, 3))
    if kind == SLIP:
        big[:4, :4] = state_matrix(p)
        load[0, 0] = -signs[0] * linear.weight - signs[1] * linear.friction
        load[:, 1] = [-p.f * linear.tilt, p.f]
        big[2:4, 4:] = np.linalg.solve(linear.mass, load)
    else:
        big[1, 3] = 1.0
        big[3, [1, 3, 5]] = np.array([-1.0, -float(p.hinge), p.f]) / linear.m22
    big[5, 6], big[6, 5] = p.xi, -p.xi
    return (expm(big * t) @ np.concatenate([y, [1.0, np.sin(phase), np.cos(phase)]]))[:4]


@pytest.mark.parametrize("kind", [SLIP, STICK, REST])
@pytest.mark.parametrize("mu", [0.0, 1e-9, 0.2])
@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0, 2.5])
def test_an_arc_is_the_matrix_exponential(kind, mu, zeta):
    x = np.array([0.25, mu, 0.7, zeta, 0.05, 0.3, 2.5])
    y = np.array([0.0 if kind == REST else 0.1, -0.2, 0.3 if kind == SLIP else 0.0, 0.4])
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):
        for t in (0.0, 0.4, 2.0):
            expected = by_exponential(x, kind, signs, y, 0.8, t)
            found = arc(x, kind, jnp.asarray(signs), y, 0.8, t)
            np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9, err_msg=f"{signs}, t = {t}")
