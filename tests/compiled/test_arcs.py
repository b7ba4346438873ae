"""Arcs in closed form, against matrix exponentials."""

import numba
import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from tpd.compiled.arcs import Forcing, Load, forcing_at, instant, launch, load_at, state_at

from tests.compiled.plants import entry, plants_of
from tests.reference import matrices, parameters
from tpd.compiled import arcs
from tpd.compiled.columns import REST, SLIP, STICK
from tpd.compiled.motion import NO, YES
from tpd.compiled.plant import STEP
from tpd.theory.equations import Linear

pair, exponential, sincos = map(entry, (arcs.pair, arcs.exponential, arcs.sincos))
PAIRS = [(0.0, 4.0), (0.3, 4.0), (40.0, 5.0), *((2.0, 1.0 + d) for d in (-1e-3, -1e-6, 0.0, 1e-6, 1e-3))]


@pytest.mark.parametrize(("p", "q"), PAIRS)
def test_an_arc_solves_its_equation_at_any_damping(p, q):
    for t in (0.0, 1e-6, 0.03, 1.0, 8.0):
        expected = expm(np.array([[0.0, 1.0], [-q, -p]]) * t)[0]
        np.testing.assert_allclose(pair(p, q, t), expected, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("x", [-300.0, -0.3, 0.0, 1e-20, 2.0, 600.0])
def test_exponential_and_sine_have_complex_step_derivatives(x):
    z = complex(x, 3.0 * STEP)
    found = np.array([exponential(z), *sincos(z)])
    expected = np.array([np.exp(x), np.sin(x), np.cos(x)])
    np.testing.assert_allclose(found.real, expected, rtol=1e-15)
    np.testing.assert_allclose(found.imag / (3.0 * STEP), expected[[0, 2, 1]] * [1.0, 1.0, -1.0], rtol=1e-15)


@numba.njit
def eta(plants, f, i, s, t):
    return forcing_at(load_at(plants[0], f, i, s), t)


def test_a_forcing_can_continue_from_any_time_of_its_piece():
    plants = plants_of([(0.25, 0.1, 0.7, 0.1, 0.05, 0.3, 2.5)])
    c = np.array([[0.4, -0.9, 0.5, 0.3], [0.3, 1.0, 0.0, -0.2], [0.0, 0.0, 0.0, 0.0]])
    sampled, growing = Forcing(NO, 0.0, 0.0, 2, c[:2]), Forcing(YES, 0.3, 0.2, 0, c[:2])
    for s, t in ((0.0, 0.7), (0.4, 0.3), (1.1, 0.0)):
        for i, p in enumerate(map(np.polynomial.Polynomial, c)):
            known = p((s + t) / 2.5), p.deriv()((s + t) / 2.5) / 2.5
            assert eta(plants, sampled, i, s, t) == pytest.approx(known, rel=1e-14)
        size, late = 0.3 + 0.2 * (s + t), 2.5 * (s + t)
        known = size * np.sin(late), 0.2 * np.sin(late) + 2.5 * size * np.cos(late)
        assert eta(plants, growing, 0, s, t) == pytest.approx(known, rel=1e-14)


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
        mass, damping, stiffness = matrices(linear)
        inverse = np.linalg.inv(mass)
        own = np.vstack([np.eye(4)[2:], np.hstack([-inverse @ stiffness, -inverse @ damping])])
        constant[2:, 0] = inverse @ [-tilt * linear.weight - way * linear.friction, 0.0]
        forced[2:, 0] = inverse @ [-p.f * linear.tilt, p.f]
    else:
        own[1, 3] = 1.0
        own[3, [1, 3]] = -1.0 / linear.m22, -float(p.hinge) / linear.m22
        forced[3, 0] = p.f / linear.m22
    if load.xi:
        # sin, cos, t sin and t cos of phase + xi t.
        turning = load.xi * np.array([[0.0, 1.0], [-1.0, 0.0]])
        functions, factors = block_diag(turning, turning), [load.e0, 0.0, load.e1, 0.0]
        functions[2, 0] = functions[3, 1] = 1.0
        start = [np.sin(load.phase), np.cos(load.phase), 0.0, 0.0]
    else:
        # 1, t, t^2 and t^3.
        functions, factors, start = np.diag([1.0, 2.0, 3.0], -1), load[2:], [1.0, 0.0, 0.0, 0.0]
    big = block_diag(own, functions, 0.0)
    big[:4, 4:8], big[:4, 8:] = forced * factors, constant
    return (expm(big * t) @ np.concatenate([y, start, [1.0]]))[:4]


LOADS = {"growing": Load(2.5, 0.8, 0.3, 0.2, 0.0, 0.0), "cubic": Load(0.0, 0.0, 0.4, -0.9, 0.5, 0.3)}


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("kind", [SLIP, STICK, REST])
@pytest.mark.parametrize(("mu", "zeta"), [(0.0, 1.0), (1e-9, 2.5), (0.2, 0.0), (0.2, 0.3), (0.2, 1.0)])
def test_an_arc_equals_the_matrix_exponential(load, kind, mu, zeta):
    x = np.array([0.25, mu, 0.7, zeta, 0.05, 0.3, 2.5])
    y = np.array([0.0 if kind == REST else 0.1, -0.2, 0.3 if kind == SLIP else 0.0, 0.4])
    plants = plants_of(x[None])
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):
        for t in (0.0, 0.4, 2.0):
            mode = (kind, *signs)
            expected = by_exponential(x, mode, y, load, t)
            found = arc(plants, mode, y, load, t)
            np.testing.assert_allclose(found[:4], expected, rtol=1e-8, atol=1e-9, err_msg=f"{signs}, t = {t}")
