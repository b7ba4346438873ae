"""Taylor series of both equations: they solve the equations, and no root of theirs is missed."""

import math

import numba
import numpy as np
import pytest

import tpd
from tests.reference import NAMES, EventDriven, parameters
from tpd.compiled import series
from tpd.compiled.columns import REST, SLIP, STICK
from tpd.compiled.forcing import Load
from tpd.compiled.motion import MOTION
from tpd.compiled.plant import PLANT
from tpd.compiled.rows import row_of
from tpd.compiled.series import DOWN, PHI, PSI, UP, WORK, R, V
from tpd.theory.equations import Equations

polyval, polyder = np.polynomial.polynomial.polyval, np.polynomial.polynomial.polyder
both_equations = pytest.mark.parametrize("terms", [tpd.Terms.linear, tpd.Terms.nonlinear])


@numba.njit(error_model="numpy")
def solved(x, linear, y, held, load, rtol, works):
    """Series of a block that slips, or is held: its order and its length."""
    plants, motions = np.zeros(1, PLANT), np.zeros(1, MOTION)
    q, m, w = plants[0], motions[0], works[0]
    series.coefficients(x, linear, q)
    m.kind, m.tilt, m.direction = (
        (STICK if y[0] != 0.0 else REST) if held else SLIP,
        np.sign(y[0]),
        np.sign(y[2]),
    )
    w.rate, w.swing = 10.0, 10.0
    series.set_accuracy(q, rtol, w)
    found = series.expand(q, m, y, load, 9.0, w)
    return found, len(plants) + len(motions)


@numba.njit
def positive_until(works, row, sign, order, floor, h):
    return series.positive_until(works[0], row, sign, order, floor, h)


@numba.njit
def largest_turn(works, row, order, h, threshold):
    return series.largest_turn(works[0], row, order, h, threshold)


def motions(count=10, seed=3):
    """Random parameters, states and times."""
    u = np.random.default_rng(seed).random((count, 12))
    for v in u:
        nu = 0.1 + 0.25 * v[0]
        x = (nu, 0.4 * v[1], 0.2 + 1.3 * v[2], 0.4 * v[3], nu * v[4], 2.0 * nu, 1.0 + 5.0 * v[5])
        yield parameters(x), (2.0 * v[6:10] - 1.0) * [nu, 0.8, nu, 1.0], 3.0 * v[10]


def expanded(p, terms, y, load, *, held=False, rtol=1e-13):
    """The rows of a series, and the time for which it is accurate."""
    works = np.zeros(1, WORK)
    (order, h), _ = solved(row_of(p), float(terms is tpd.Terms.linear), y, held, load, rtol, works)
    return works["series"][0][:, : order + 1], h


LOADS = {
    "full": lambda p, t: Load(p.xi, p.xi * t, 1.0, 0.0, 0.0, 0.0),
    "growing": lambda p, t: Load(p.xi, p.xi * t, 0.1 + 0.05 * t, 0.05, 0.0, 0.0),
    "cubic": lambda p, t: Load(0.0, 0.0, 0.4, -0.9, 0.5, 0.3),
}


@both_equations
@pytest.mark.parametrize("held", ["slips", "tilted", "on its base"])
@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
def test_a_taylor_series_solves_the_equations(load, held, terms):
    for p, y, t in motions():
        y = y * {"slips": 1.0, "tilted": [1, 1, 0, 1], "on its base": [0, 1, 0, 1]}[held]
        e = load(p, t)
        c, h = expanded(p, terms, y, e, held=held != "slips")
        assert 0.05 < h <= 9.0
        loop = EventDriven(
            [float(getattr(p, name)) for name in NAMES[:7]], nonlinear=terms is tpd.Terms.nonlinear
        )
        for s in (0.0, 0.6 * h):
            state, slope = (
                np.array([polyval(s, f(c[row])) for row in (PHI, PSI, V, R)]) for f in (np.asarray, polyder)
            )
            eta = polyval(s, e[2:]) * (math.sin(e.phase + e.xi * s) if e.xi else 1.0)
            if held == "slips":
                side, way = np.sign(y[0]), np.sign(y[2])
                expected = Equations(p, terms).rates(state, side, way, eta)
            else:
                loop._shaking = lambda _, size=loop.f * eta: size
                expected = loop.held(0.0, state)
                # The signals of the release to either side.
                up, down = (1.0, -1.0) if y[0] == 0.0 else np.sign(y[[0, 0]])
                for row, sign, side in ((UP, -1.0, up), (DOWN, 1.0, down)):
                    signal = loop.k + sign * loop.excess(0.0, state, side)
                    assert polyval(s, c[row]) == pytest.approx(signal, rel=0, abs=2e-10)
            np.testing.assert_allclose(slope, expected, atol=2e-10)


@pytest.mark.parametrize("held", [False, True])
def test_a_series_of_the_linear_equations_equals_the_arc_in_closed_form(held):
    for p, y, t in motions():
        y = y * [1.0, 1.0, 1.0 - held, 1.0]
        c, h = expanded(p, tpd.Terms.linear, y, LOADS["full"](p, t), held=held)
        signs = {"side": int(np.sign(y[0])), "direction": int(np.sign(y[2]))}
        for s in (0.3 * h, h):
            expected = tpd.theory.arc(p, y, t, t + s, **signs)
            np.testing.assert_allclose(polyval(s, c[[PHI, PSI, V, R]].T), expected, rtol=0, atol=1e-13)


def test_no_root_is_missed():
    """Polynomials made of random roots, in half of them two close to one another."""
    draws, met = np.random.default_rng(5), 0
    for case in range(400):
        roots = draws.uniform(-3.0, 3.0, 7)
        if case % 2:
            roots[1] = roots[0] + 10.0 ** draws.uniform(-6.0, -1.0)
        works = np.zeros(1, WORK)
        c = works["series"][0, V]
        c[:8] = np.polynomial.polynomial.polyfromroots(roots)
        way, first = math.copysign(1.0, c[0]), min([r for r in roots if r > 0.0], default=9.0)
        t, found = positive_until(works, V, way, 7, 0.0, 1.0)
        assert t <= first + 1e-9
        if found:
            assert t == pytest.approx(first, abs=1e-5)
        else:
            # Without a root the proof ends at the end, or before a root that it cannot tell from none.
            assert t == 1.0 or abs(polyval(t, c[:8])) < 1e-3
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
    works = np.zeros(1, WORK)
    works["series"][0, UP, : len(coefficients)], works["tiny"] = coefficients, 1e-15
    assert positive_until(works, UP, 1.0, 6, 0.0, 1.0) == (pytest.approx(until, abs=1e-12), found)


@both_equations
def test_the_largest_angle_of_a_series_equals_dense_sampling(terms):
    met = 0
    for p, y, t in motions():
        c, h = expanded(p, terms, y, LOADS["full"](p, t), rtol=1e-9)
        works = np.zeros(1, WORK)
        works["series"][0, :, : c.shape[1]] = c
        angle, when = largest_turn(works, PSI, c.shape[1] - 1, h, 0.0)
        values = polyval(np.array([when, *np.linspace(0.0, h, 4001)]), c[PSI])
        # The ends of a step are known already.
        sampled, turns = np.abs(values[1:]), angle != 0.0
        assert max(abs(angle), sampled[0], sampled[-1]) == pytest.approx(sampled.max(), abs=1e-6)
        assert 0.0 <= when <= h
        assert not turns or values[0] == pytest.approx(angle)
        met += turns
    assert met >= 1
