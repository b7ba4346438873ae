"""Taylor series of the nonlinear equations (4): they solve the equations, and no root of theirs is missed."""

import math

import numba
import numpy as np
import pytest

import tpd
from tests.compiled.plants import entry
from tests.reference import NAMES, EventDriven, parameters
from tpd.compiled import nonlinear_series as series
from tpd.compiled.arcs import Load
from tpd.compiled.columns import REST, SLIP, STICK
from tpd.compiled.motion import MOTION
from tpd.compiled.nonlinear_series import ORDERS, PHI, PSI, ROWS, R, V
from tpd.compiled.plant import PLANT, coefficients
from tpd.compiled.rows import row_of
from tpd.theory.equations import Equations

ORDER = 24


@numba.njit(error_model="numpy")
def solved(x, y, held, growth, t, rtol, c):
    """Series about t of a block that slips, or is held: its order and its length."""
    plants, motions, works = np.zeros(1, PLANT), np.zeros(1, MOTION), np.zeros(1, series.WORK)
    q, m, w = plants[0], motions[0], works[0]
    coefficients(x, q)
    m.y[:] = y
    m.kind, m.tilt, m.direction = (
        (STICK if y[0] != 0.0 else REST) if held else SLIP,
        np.sign(y[0]),
        np.sign(y[2]),
    )
    w.order, w.rtol, w.rate, w.swing, w.inverse[2] = ORDER, rtol, 10.0, 10.0, 1.0 / rtol
    size = growth[0] + growth[1] * t
    found = series.expand(q, m, Load(x[6], x[6] * t, size, growth[1], 0.0, 0.0), 9.0, w)
    c[:] = w.series
    return found, len(plants) + len(motions) + len(works)


positive_until, largest_turn = entry(series.positive_until), entry(series.largest_turn)


def motions(count=10, seed=3):
    u = np.random.default_rng(seed).random((count, 12))
    for v in u:
        nu = 0.1 + 0.25 * v[0]
        x = (nu, 0.4 * v[1], 0.2 + 1.3 * v[2], 0.4 * v[3], nu * v[4], 2.0 * nu, 1.0 + 5.0 * v[5])
        yield parameters(x), (2.0 * v[6:10] - 1.0) * [nu, 0.8, nu, 1.0], 3.0 * v[10]


def at(c, order, t):
    """State and its derivative at a time."""
    rows = c[[PHI, PSI, V, R], : order + 1]
    slopes = np.array(
        [np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(r)) for r in rows]
    )
    return np.array([np.polynomial.polynomial.polyval(t, r) for r in rows]), slopes


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("growth", [[1.0, 0.0], [0.1, 0.05]])
def test_a_taylor_series_solves_the_nonlinear_equations(held, growth):
    for p, y, t in motions():
        y = y * [1.0, 1.0, 0.0, 1.0] if held else y
        c = np.zeros((ROWS, ORDERS))
        (order, h), _ = solved(row_of(p), y, held, np.array(growth), t, 1e-13, c)
        assert 0.05 < h <= 9.0
        for share in (0.0, 0.6):
            state, slope = at(c, order, share * h)
            later = t + share * h
            sine = (growth[0] + growth[1] * later) * math.sin(p.xi * later)
            equations, side = Equations(p, tpd.Terms.nonlinear), math.copysign(1.0, y[0])
            if held:
                loop = EventDriven([float(getattr(p, name)) for name in NAMES[:7]], nonlinear=True)
                loop.f *= growth[0] + growth[1] * later
                expected = loop.held(later, state)
            else:
                expected = equations.rates(state, side, math.copysign(1.0, y[2]), sine)
            np.testing.assert_allclose(slope, expected, atol=2e-10)


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
        t, found = positive_until(c, V, way, 7, 0.0, 1.0)
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
def test_a_signal_that_begins_at_zero_has_the_sign_of_its_first_values(coefficients, until, found):
    c = np.zeros((ROWS, ORDERS))
    c[V, : len(coefficients)] = coefficients
    assert positive_until(c, V, 1.0, 6, 0.0, 1.0) == (pytest.approx(until, abs=1e-12), found)


def test_the_largest_angle_of_a_series_equals_dense_sampling():
    met = 0
    for p, y, t in motions():
        c = np.zeros((ROWS, ORDERS))
        (order, h), _ = solved(row_of(p), y, False, np.array([1.0, 0.0]), t, 1e-9, c)
        angle, when = largest_turn(c, PSI, order, h, 0.0)
        values = np.polynomial.polynomial.polyval(
            np.array([when, *np.linspace(0.0, h, 4001)]), c[PSI, : order + 1]
        )
        # The ends of a step are in the tally already.
        sampled, turns = np.abs(values[1:]), angle != 0.0
        assert max(abs(angle), sampled[0], sampled[-1]) == pytest.approx(sampled.max(), abs=1e-6)
        assert 0.0 <= when <= h
        assert not turns or values[0] == pytest.approx(angle)
        met += turns
    assert met >= 1
