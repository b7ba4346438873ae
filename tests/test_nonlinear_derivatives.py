"""Derivatives of the nonlinear model against central differences of an independent event loop."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

import tpd
from tests.reference import NAMES, EventDriven, Mode, largest, parameters
from tpd.scene.parameters import unchecked

MODEL = tpd.Nonlinear(rtol=1e-12, rest_rate=1e-7)
SLIP, STICK, REST = {"slip"}, {"slip", "stick"}, {"slip", "rest"}
MOTIONS = {
    "impacts": ((0.25, 0.2, 0.8, 0.1, 0.02, 0.5, 3.5, 0.9, 1.3), (0.1, 0.1, 0.02, -0.3), SLIP),
    "no pendulum": ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 0.95, 2.0), (0.1, 0.1, 0.02, 0.1), SLIP),
    "held": ((0.25, 0.2, 0.34, 0.25, 0.28, 0.59, 2.62, 0.95, 2.0), (0.1, 0.1, 0.0, 0.1), STICK),
    "released": ((0.2, 0.1, 0.5, 0.2, 0.02, 0.3, 2.5, 0.9, 1.5), (0.0, 0.05, 0.0, 0.1), REST),
    "landed": ((0.2, 0.0, 0.5, 0.2, 0.05, 0.3, 1.5, 0.0, 2.4), (0.03, 0.05, 0.02, 0.1), REST),
    "at rest": ((0.2, 0.0, 0.5, 0.2, 0.05, 0.12, 2.5, 0.0, 1.5), (0.03, 0.05, 0.02, 0.1), REST),
}
"""Parameters with the height of the hinge, initial state, and the modes that must occur."""
SAMPLES = 1.1 * np.array([0.0, 1.0, 2.5, 0.5, -2.0, -3.0, -1.0, 2.0, 3.0, 1.0, -1.5, -0.5, 0.0])


class Loop(EventDriven):
    """The event loop, which also keeps the tilts at its events."""

    def __init__(self, x: Any, **options: Any) -> None:
        super().__init__(x[:8], nonlinear=True, kappa=x[8], **options)
        self.turns = [0.0]

    def _event(self, t: float, y: np.ndarray, mode: Mode, which: int, quiet: float) -> tuple:
        self.turns.append(y[0])
        return super()._event(t, y, mode, which, quiet)


def at(x: Any) -> tpd.Parameters:
    """The parameters in a vector of nine."""
    return unchecked(parameters(x[:8]), kappa=x[8])


def differences(function: Callable[[np.ndarray], np.ndarray], x: Any) -> np.ndarray:
    """Central differences in all inputs."""
    x = np.array(x, dtype=float)
    steps = 4e-6 * np.maximum(np.abs(x), 0.1)
    columns = [function(x + step) - function(x - step) for step in np.diag(steps)]
    return np.stack(columns, axis=-1) / (2.0 * steps)


def assert_derivatives(function: Callable[[Any], Any], x: Any, expected: np.ndarray) -> None:
    """Compare derivatives in both modes, compiled for a batch or not, in the inputs that are not zero. At
    zero the initial state is at an event, or a parameter is at its bound."""
    x = jnp.array(x, dtype=float)
    inputs, scale = np.flatnonzero(x), np.abs(expected).max(axis=-1, keepdims=True) + 1e-3
    for slopes in jax.jacfwd(function)(x), *jax.jit(jax.vmap(jax.jacrev(function)))(jnp.stack([x, x])):
        assert_allclose(((slopes - expected) / scale)[:, inputs], 0.0, atol=1e-5)


@pytest.mark.parametrize("name", MOTIONS)
def test_derivatives_of_a_trajectory_equal_differences_in_every_mode(name):
    x, y0, kinds = MOTIONS[name]
    times = np.array([0.0, 2.0, 3.0, 5.0])
    (loop := Loop(x)).run(y0, times)
    assert kinds <= set(loop.kinds)
    expected = differences(lambda v: Loop(v[:9]).run(v[9:], times)[1:].ravel(), (*x, *y0))
    states = lambda v: tpd.simulate(at(v[:9]), v[9:], times, model=MODEL).ys[1:].ravel()  # noqa: E731
    assert_derivatives(states, (*x, *y0), expected)


@pytest.mark.parametrize("name", ["impacts", "held", "landed"])
def test_derivatives_of_a_steady_state_equal_differences(name):
    x, y0, _ = MOTIONS[name]
    solve = partial(tpd.steady_state, y0=np.array(y0), model=MODEL, throw=True)
    steady = solve(at(x))

    def period(v: np.ndarray) -> np.ndarray:
        loop = Loop(v[:9])
        ys = loop.run(v[9:], np.linspace(0.0, int(steady.periods) * loop.period_of_excitation, 2001))
        # Beside a symmetric orbit the angles of both sides change differently. Take one side.
        return np.array([max(loop.turns), largest(ys[:, 1]), *ys[-1]])

    # The fixed point y = P(y, x) of the period map moves by (I - DP)^-1 dP/dx.
    by = differences(period, (*x, *np.asarray(steady.state)))
    moved = np.linalg.solve(np.eye(4) - by[2:, 9:], by[2:, :9])
    expected = np.concatenate([by[:2, :9] + by[:2, 9:] @ moved, moved])
    numbers = lambda s: jnp.stack([s.amplitude, s.swing, *s.state])  # noqa: E731
    assert_derivatives(lambda v: numbers(solve(at(v))), x, expected)
    multipliers = np.linalg.eigvals(by[2:, 9:] if x[1] else by[2::2, 9::2])
    assert float(steady.multiplier) == pytest.approx(np.abs(multipliers).max(), abs=1e-5)


@pytest.mark.parametrize(("friction", "e"), [(0.0, 0.9), (0.02, 0.95), (0.1, 0.9), (0.08, 0.8)])
def test_derivatives_of_a_transient_under_a_record_equal_differences(friction, e):
    def shaken(width, height, mass, bob, length, damping, hinge, gravity, scale):
        block = tpd.Block(width=width, height=height, mass=mass, friction=friction, restitution=e)
        pendulum = tpd.Pendulum(mass=bob, length=length, damping_ratio=damping, hinge_height=hinge)
        return tpd.Scene(block, tpd.Record(SAMPLES, 0.2, scale=scale), gravity), pendulum

    def known(v: np.ndarray) -> np.ndarray:
        scene, pendulum = shaken(*v[:9])
        p, speeds = scene.ground_parameters(pendulum), np.array([1.0, 1.0, scene.rate, scene.rate])
        x = [float(getattr(p, name)) for name in NAMES]
        loop = Loop(x, samples=(-v[8] * SAMPLES / v[7], 0.2 * speeds[2]))
        ys = loop.run(v[9:13] / speeds, np.linspace(0.0, (2.4 + v[13]) * speeds[2], 8001))
        angles = max(map(abs, loop.turns)), *map(largest, np.abs([ys[:, 1], ys[:, 1] - ys[:, 0]]))
        return np.array([*angles, *ys[-1] * speeds])

    def numbers(v: Any) -> Any:
        run = tpd.transient(*shaken(*v[:9]), y0=v[9:13], free=v[13], model=MODEL)
        return jnp.stack([run.tilt, run.swing, run.rod_angle, *run.state])

    v = np.array([0.7, 4.0, 2210.0, 221.0, 1.2, 0.3, 3.0, 9.81, 1.0, 0.01, 0.05, 0.01, 0.1, 0.8])
    assert_allclose(numbers(v), known(v), atol=1e-7)
    assert_derivatives(numbers, v, differences(known, v))


def test_the_derivative_of_a_critical_scale_equals_differences():
    samples = np.array([0.0, 2.0, 2.0, 1.0, 0.0])

    def scene(v: Any) -> tpd.Scene:
        block = tpd.Block(width=v[0], height=v[1], mass=2000.0, restitution=v[2])
        return tpd.Scene(block, tpd.Record(samples, 0.25))

    def beyond(scale: float, v: np.ndarray) -> float:
        # At the critical scale the energy at the end of the record is that of the block on its corner.
        nu, rate = v[0] / v[1], float(scene(v).rate)
        x = nu, 0.0, 0.4, 0.2, 0.0, 0.1, 1.0, v[2], 2.0
        loop = Loop(x, samples=(-scale * samples / 9.80665, 0.25 * rate))
        phi, _, dphi, _ = loop.run(np.zeros(4), np.array([0.0, rate]))[-1]
        return 0.5 * dphi**2 + np.cos(phi) + nu * np.sin(abs(phi)) - np.hypot(1.0, nu)

    solve = partial(tpd.critical_scale, model=MODEL, scan=0.05, free=10.0)
    scale = lambda v: jnp.atleast_1d(solve(scene(v)).scale)  # noqa: E731
    known = lambda v: np.array([brentq(beyond, 1.3, 1.4, args=(v,), xtol=1e-13)])  # noqa: E731
    v = np.array([0.7, 4.0, 0.9])
    assert_allclose(scale(v), known(v), rtol=1e-8)
    assert_derivatives(scale, v, differences(known, v))
