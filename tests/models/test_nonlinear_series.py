"""Taylor series of the nonlinear equations (4): they solve the equations, and no root of theirs is missed."""

import math

import numba
import numpy as np
import pytest

import tpd
from tpd.core.equations import Equations
from tpd.models import nonlinear_series as series
from tpd.models.compiled_linear import packed
from tpd.models.nonlinear_kernel import plant
from tpd.models.nonlinear_series import DOWN, ORDERS, PHI, PSI, ROWS, UP, R, V

ORDER = 24


@numba.njit(error_model="numpy")
def solved(x, y, way, held, growth, t, rtol, c):
    """Series about t of a block that slips to the side `way`, or is held: its order and its length."""
    q = plant(x, x[6], 2.0 * math.pi / x[6], 1e-4)
    inverse = np.full(3, 1.0 / rtol)
    c[PHI, 0], c[PSI, 0], c[V, 0], c[R, 0] = y[0], y[1], y[2], y[3]
    series.put_forcing(q, growth, t, ORDER, c)
    tilt = math.copysign(1.0, y[0])
    if held:
        order = series.held_series(q, tilt if y[0] != 0.0 else 0.0, ORDER, 9.0, inverse, c)
    else:
        order = series.slipping_series(q, tilt, way, ORDER, 9.0, inverse, c)
    return order, series.length_of(c, order, 9.0, inverse)


@numba.njit(error_model="numpy")
def free_until(c, row, way, order, floor, h):
    return series.free_until(c, row, way, order, floor, h)


@numba.njit(error_model="numpy")
def largest_within(c, row, rate, order, h):
    return series.largest_within(c, row, rate, order, h, series.value_at(c, row, order, h))


def motions(count=20, seed=3):
    u = np.random.default_rng(seed).random((count, 12))
    for v in u:
        nu = 0.1 + 0.25 * v[0]
        p = tpd.Parameters(
            nu=nu,
            mu=0.4 * v[1],
            lam=0.2 + 1.3 * v[2],
            zeta=0.4 * v[3],
            k=nu * v[4],
            f=2.0 * nu,
            xi=1.0 + 5.0 * v[5],
        )
        yield p, (2.0 * v[6:10] - 1.0) * [nu, 0.8, nu, 1.0], 3.0 * v[10]


def at(c, order, t):
    """State and its derivative at a time."""
    rows = c[[PHI, PSI, V, R], : order + 1]
    slopes = np.array(
        [np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(r)) for r in rows]
    )
    return np.array([np.polynomial.polynomial.polyval(t, r) for r in rows]), slopes


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("growth", [[1.0, 0.0], [0.1, 0.05]])
def test_a_series_solves_the_equations(held, growth):
    for p, y, t in motions():
        y = y * [1.0, 1.0, 0.0, 1.0] if held else y
        c = np.zeros((ROWS, ORDERS))
        order, h = solved(
            np.asarray(packed(p)), y, math.copysign(1.0, y[2]), held, np.array([*growth, 0, 0]), t, 1e-13, c
        )
        assert 0.05 < h <= 9.0
        for share in (0.0, 0.6):
            state, slope = at(c, order, share * h)
            later = t + share * h
            sine = (growth[0] + growth[1] * later) * math.sin(p.xi * later)
            equations, side = Equations(p, tpd.Terms.nonlinear), math.copysign(1.0, y[0])
            if held:
                expected = equations.held_rates(state, sine)
            else:
                expected = equations.rates(state, side, math.copysign(1.0, y[2]), sine)
            np.testing.assert_allclose(slope, expected, atol=2e-10)


@pytest.mark.parametrize("leans", [False, True])
def test_signals_of_a_held_block_are_those_of_the_moment_on_it(leans):
    for p, y, t in motions():
        y = y * [float(leans), 1.0, 0.0, 1.0]
        c, ones = np.zeros((ROWS, ORDERS)), np.array([1.0, 0.0, 0.0, 0.0])
        order, h = solved(np.asarray(packed(p)), y, 0.0, True, ones, t, 1e-13, c)
        state, slope = at(c, order, 0.5 * h)
        equations, sine = Equations(p, tpd.Terms.nonlinear), math.sin(p.xi * (t + 0.5 * h))
        for row, way in ((UP, 1.0), (DOWN, -1.0)):
            side = math.copysign(1.0, y[0]) if leans else way
            # What is left of the friction is the moment that a block that stays needs to begin to move.
            freed = np.asarray(equations.rates(state, side, way, sine))
            signal = np.polynomial.polynomial.polyval(0.5 * h, c[row, : order + 1])
            # Acceleration of the freed block times its inertia about the corner, with the bob's.
            arm = np.asarray(equations.rates(state, side, way - 1e-3 / p.k, sine))
            inertia = 1e-3 / (arm[2] - freed[2])
            assert signal == pytest.approx(-way * inertia * freed[2], abs=1e-9)
        assert slope[0] == slope[2] == 0.0


def test_no_root_is_missed():
    """Polynomials made of random roots, in half of them two close to one another."""
    draws, met = np.random.default_rng(5), 0
    for case in range(400):
        roots = draws.uniform(-3.0, 3.0, 7)
        if case % 2:
            roots[1] = roots[0] + 10.0 ** draws.uniform(-6.0, -1.0)
        c = np.zeros((ROWS, ORDERS))
        c[V, :8] = np.polynomial.polynomial.polyfromroots(roots)
        way, first = math.copysign(1.0, c[V, 0]), min([r for r in roots if r > 0.0], default=9.0)
        t, found = free_until(c, V, way, 7, 0.0, 1.0)
        assert t <= first + 1e-9
        if found:
            assert t == pytest.approx(first, abs=1e-5)
        else:
            # Without a root the proof ends at the end, or before a root that it cannot tell from none.
            assert t == 1.0 or abs(np.polynomial.polynomial.polyval(t, c[V, :8])) < 1e-3
        met += found
    assert met > 100


@pytest.mark.parametrize(
    ("coefficients", "until", "found"),
    [
        ([0.0, 1.0, -2.0], 0.5, True),
        ([1e-18, -1e-18, 1.0, -4.0], 0.25, True),
        ([0.0, -1.0, 5.0], 0.0, True),
        ([0.0, 0.0, 1.0], 1.0, False),
        ([-0.1, 1.0], 0.0, True),
        ([1.0, -0.5], 1.0, False),
    ],
)
def test_a_signal_that_begins_at_zero_has_the_sign_that_it_takes_on(coefficients, until, found):
    c = np.zeros((ROWS, ORDERS))
    c[V, : len(coefficients)] = coefficients
    assert free_until(c, V, 1.0, 6, 0.0, 1.0) == (pytest.approx(until, abs=1e-12), found)


def test_the_largest_angle_is_that_of_many_samples():
    for p, y, t in motions():
        c = np.zeros((ROWS, ORDERS))
        order, h = solved(
            np.asarray(packed(p)), y, math.copysign(1.0, y[2]), False, np.array([1.0, 0, 0, 0]), t, 1e-9, c
        )
        size, when = largest_within(c, PSI, R, order, h)
        sampled = np.abs(np.polynomial.polynomial.polyval(np.linspace(0.0, h, 4001), c[PSI, : order + 1]))
        # A start that is larger than all that follows is in the tally already.
        assert max(size, sampled[0]) == pytest.approx(sampled.max(), abs=1e-6)
        assert size >= sampled[1:].max() - 1e-9 or sampled.argmax() == 0
        assert 0.0 <= when <= h
