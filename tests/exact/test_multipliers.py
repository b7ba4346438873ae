"""Small closed-form algebra: multipliers, functions of the state matrix, sines; against NumPy and SciPy."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

from tests.reference import differences, parameters
from tpd.core.eigenvalues import characteristic, quartic_roots
from tpd.core.equations import Linear
from tpd.exact.modes import Plant
from tpd.exact.propagator import Factor, components, exponential, identity
from tpd.exact.trigonometry import Turn, turn

# The quartic


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


CHARACTERISTIC = jax.jit(lambda m: jnp.stack(characteristic(tuple(tuple(row) for row in m))))


def test_characteristic_polynomial_is_that_of_numpy():
    rng = np.random.default_rng(13)
    for _ in range(50):
        m = rng.normal(size=(4, 4))
        np.testing.assert_allclose(CHARACTERISTIC(m), np.poly(m)[1:], rtol=1e-11, atol=1e-12)
        assert CHARACTERISTIC(m)[3] == pytest.approx(np.linalg.det(m), rel=1e-12, abs=1e-14)


def test_eigenvalues_of_a_matrix_from_end_to_end():
    rng = np.random.default_rng(15)
    for m in rng.normal(size=(100, 4, 4)):
        expected = np.linalg.eigvals(m)
        assert farthest(roots(CHARACTERISTIC(m))[0], expected) < 1e-9 * np.abs(expected).max()


# Cosine and sine

TURN = jax.jit(turn)
ANGLES = np.concatenate(
    [
        np.random.default_rng(16).uniform(-1e6, 1e6, 200_000),
        np.random.default_rng(17).uniform(-10.0, 10.0, 100_000),
        np.arange(-4000, 4001) * (np.pi / 4),
        np.nextafter(np.arange(-4000, 4001) * (np.pi / 4), np.inf),
        np.round(np.linspace(-6e5, 6e5, 4001)) * (np.pi / 2),
        [0.0, -0.0, 1e-300, 1e-20, 1e-8],
    ]
)


def test_a_turn_is_right_to_the_last_digit():
    found = TURN(ANGLES)
    assert np.abs(np.asarray(found.cosine) - np.cos(ANGLES)).max() < 3e-16
    assert np.abs(np.asarray(found.sine) - np.sin(ANGLES)).max() < 3e-16


def test_a_turn_next_to_a_zero_is_right_to_the_last_digit_of_what_is_left():
    # The nearest doubles to multiples of pi/2 are where reducing the angle loses digits.
    multiples = np.concatenate([np.arange(1, 200), np.arange(1, 600_000, 7919)])
    angles = multiples * (np.pi / 2)
    found = TURN(angles)
    with mpmath.workdps(60):
        for n, angle, cosine, sine in zip(multiples, angles, found.cosine, found.sine, strict=True):
            small, expected = (
                (sine, mpmath.sin(float(angle))) if n % 2 == 0 else (cosine, mpmath.cos(float(angle)))
            )
            assert abs(float(small) - float(expected)) < 3e-16 * abs(float(expected)) + 2e-22


def test_a_turn_has_unit_size_and_an_exact_derivative():
    angles = ANGLES[:1000]
    found, rate = jax.jvp(turn, (jnp.asarray(angles),), (jnp.full(angles.shape, 2.0),))
    np.testing.assert_allclose(found.cosine**2 + found.sine**2, 1.0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rate.cosine, -2.0 * found.sine)
    np.testing.assert_array_equal(rate.sine, 2.0 * found.cosine)
    second = jax.grad(jax.grad(lambda x: turn(x).sine))(0.7)
    assert second == pytest.approx(-np.sin(0.7), rel=1e-15)


def test_a_turn_by_nan_is_nan():
    for angle in (np.nan, np.inf, -np.inf):
        assert np.all(np.isnan(np.array(TURN(angle))))


def test_turns_add_and_subtract():
    a, b = turn(jnp.asarray(0.7)), turn(jnp.asarray(-2.1))
    np.testing.assert_allclose(a.then(b), turn(jnp.asarray(-1.4)), rtol=0, atol=3e-16)
    np.testing.assert_allclose(a.before(b), turn(jnp.asarray(-2.8)), rtol=0, atol=3e-16)
    assert isinstance(a.then(b), Turn)


# Functions of the state matrix


def critical(mu, lam):
    """The hinge damping at which the pair's two rates meet."""

    def apart(zeta):
        p, q = _pair(np.array([0.25, mu, lam, zeta, 0.05, 0.3, 2.5]))
        return q - 0.25 * p**2

    low, high = 0.1, 4.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if apart(middle) > 0 else (low, middle)
    return low


@jax.jit
def _pair(x):
    rates = Plant(parameters(x)).slip
    return rates.p, rates.q


def scenes():
    """Swinging, creeping, and on both sides of critical damping as close as it gets."""
    for mu, lam in ((0.0, 0.8), (1e-6, 0.8), (0.1, 0.3), (0.4, 1.4)):
        edge = critical(mu, lam)
        for zeta in (0.0, 0.1, edge * (1 - 1e-6), edge, edge * (1 + 1e-6), 3.0):
            yield np.array([0.25, mu, lam, zeta, 0.05, 0.3, 2.5, 0.9])


def state_matrix(x):
    """d rates/d state, column by column."""
    linear, zero = Linear(parameters(x)), jnp.zeros(())
    return np.stack([np.asarray(linear.rates(unit, zero, zero, zero)) for unit in jnp.eye(4)], axis=1)


def matrix_of(plant, g):
    """g(A) from its functionals."""
    return jnp.stack([jnp.stack([c.of(g) for c in components(plant, unit)]) for unit in jnp.eye(4)], axis=1)


@jax.jit
def functions(x, s, t):
    """Matrices of what can be made of exp(A s) and exp(A t)."""
    plant = Plant(parameters(x))
    rates = plant.slip
    one, first, second = identity(s), exponential(rates, s), exponential(rates, t)
    closing = one.plus(first)
    made: dict[str, Factor] = {
        "identity": one,
        "exponential": first,
        "product": first.times(second, rates),
        "inverse": closing.inverse(rates),
        "rate": first.rate(rates),
        "sum": first.scaled(2.0).plus(second.scaled(-3.0)),
        "undone": closing.times(closing.inverse(rates), rates),
    }
    out = {name: matrix_of(plant, g) for name, g in made.items()}
    v = jnp.array([0.3, -0.2, 0.5, 0.7])
    shifted = jnp.stack([c.after(first, rates).of(second) for c in components(plant, v)])
    less = jnp.stack([c.minus(0.5, c.after(first, rates)).of(second) for c in components(plant, v)])
    return out, shifted, less


@pytest.mark.parametrize(("s", "t"), [(0.3, 0.9), (1.3, -0.4), (1e-5, 2.0)])
def test_functions_of_the_state_matrix_are_those_of_scipy(s, t):
    v = np.array([0.3, -0.2, 0.5, 0.7])
    for x in scenes():
        a = state_matrix(x)
        first, second = expm(a * s), expm(a * t)
        expected = {
            "identity": np.eye(4),
            "exponential": first,
            "product": expm(a * (s + t)),
            "inverse": np.linalg.inv(np.eye(4) + first),
            "rate": a @ first,
            "sum": 2.0 * first - 3.0 * second,
            "undone": np.eye(4),
        }
        found, shifted, less = functions(x, s, t)
        for name, matrix in expected.items():
            scale = np.abs(matrix).max()
            np.testing.assert_allclose(found[name], matrix, rtol=0, atol=1e-10 * scale, err_msg=f"{name} {x}")
        scale = np.abs(second @ first @ v).max() + np.abs(second @ v).max()
        np.testing.assert_allclose(shifted, second @ first @ v, rtol=0, atol=1e-10 * scale)
        np.testing.assert_allclose(less, second @ v - 0.5 * second @ first @ v, rtol=0, atol=1e-10 * scale)


SLOPES = jax.jit(jax.jacfwd(lambda x: functions(x, 0.3, 0.9)[0]["inverse"]))


@pytest.mark.parametrize("zeta", [0.1, "critical", 3.0])
def test_functions_of_the_state_matrix_have_the_slopes_of_differences(zeta):
    damping = critical(0.1, 0.3) if zeta == "critical" else zeta
    x = np.array([0.25, 0.1, 0.3, damping, 0.05, 0.3, 2.5, 0.9])

    def inverse(x):
        return np.linalg.inv(np.eye(4) + expm(0.3 * state_matrix(x)))

    for i in range(4):
        expected = differences(inverse, x, i, share=0.01)
        np.testing.assert_allclose(
            SLOPES(x)[:, :, i], expected, rtol=0, atol=1e-7 * np.abs(expected).max() + 1e-9
        )
