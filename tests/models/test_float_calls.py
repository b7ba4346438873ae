"""Calls with plain numbers, which reach the engine without JAX: the answers of traced calls, bit for bit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Parameters, steady_state, symmetric_orbits
from tpd.scene.status import status_name

FIELDS = "nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e"
REST = (0.0, 0.0, 0.0, 0.0)
SCENES = {
    "rocking": ((0.21, 0.2, 0.35, 0.0, 0.3, 0.57, 4.0, 0.7, 0.9), REST),
    "sticking": ((0.39, 0.2, 0.63, 0.1, 0.0, 0.2, 1.5, 0.7, 0.9), REST),
    "rest": ((0.31, 0.2, 0.33, 0.1, 0.02, 0.12, 3.0, 0.7, 1.0), REST),
    "held": ((0.19, 0.1, 0.41, 0.1, 0.3, 0.06, 0.5, 0.7, 1.0), (0.17, -0.2, -0.18, 0.18)),
    "overturned": ((0.31, 0.0, 0.83, 0.1, 0.0, 0.13, 2.1, 0.7, 1.0), (0.13, 0.2, -0.27, -0.38)),
    "aperiodic": ((0.15, 0.2, 0.8, 0.0, 0.3, 0.62, 2.0, 0.7, 1.0), REST),
    "not_settled": ((0.41, 0.2, 0.75, 0.0, 0.02, 0.47, 1.7, 0.7, 0.9), REST),
    "unstable": (
        (0.3, 0.1, 0.32, 0.0, 0.0, 0.35, 3.2, 0.7, 0.9),
        (0.0015017397909662389, 0.01538784493228143, -0.07054417264844041, -1.5191477938172269),
    ),
    "neutral": (
        (0.18, 0.1, 0.41, 0.0, 0.0, 0.16, 2.9, 0.7, 1.0),
        (-2.9868034318797804e-17, 2.4022214941105952e-17, 0.16207357974827397, 0.954462887283928),
    ),
    "near_fold": ((0.27, 0.0, 0.82, 0.0, 0.3, 0.06, 0.6, 0.7, 1.0), (0.03, -0.05, 0.0, 0.43)),
    "event_bound": ((0.3, 0.2, 0.99, 0.1, 0.0, 0.09, 2.6, 0.7, 1.0), (0.0, 0.01, -0.03, -0.01)),
    "failed": ((0.25, 0.0, 0.5, 0.0, 0.05, 0.3, 2.0, 0.5, 0.9), REST),
}
"""Parameters and start by the status of the motion."""


def settled(x, y0):
    return steady_state(
        Parameters(**dict(zip(FIELDS, x, strict=True))),
        y0=y0 if isinstance(y0, jax.Array) else np.asarray(y0),
    )


traced = jax.jit(settled)


@pytest.mark.parametrize("status", SCENES)
def test_plain_numbers_have_the_answer_of_traced_ones(status):
    x, y0 = SCENES[status]
    found, expected = settled(x, y0), traced(np.array(x), np.array(y0))
    assert status_name(found.status) == status
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for ours, theirs in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        assert isinstance(ours, (int, float, np.generic, np.ndarray))
        assert np.asarray(ours).tobytes() == np.asarray(theirs, dtype=np.asarray(ours).dtype).tobytes()


def test_orbits_of_plain_numbers_are_those_of_traced_ones():
    p = Parameters(**dict(zip(FIELDS, SCENES["unstable"][0], strict=True)))
    found, expected = (jax.tree.leaves(solve(p)) for solve in (symmetric_orbits, jax.jit(symmetric_orbits)))
    for ours, theirs in zip(found, expected, strict=True):
        assert isinstance(ours, (np.generic, np.ndarray))
        np.testing.assert_array_equal(ours, theirs, strict=True)


def test_arrays_of_one_number_and_wholes_have_the_answer_of_floats():
    x, y0 = SCENES["rocking"]
    found = [settled(given, y0) for given in (x, map(np.asarray, x), jnp.asarray(x), np.array(x))]
    whole = [settled((*x[:6], xi, *x[7:]), np.zeros(4, int)) for xi in (4, 4.0, np.float64(4.0))]
    assert len({(float(s.amplitude), float(s.stroke), *map(float, s.state)) for s in [*found, *whole]}) == 1


def test_a_derivative_in_one_of_plain_numbers_is_that_of_the_answer():
    x, y0 = SCENES["rocking"]

    def amplitude(f):
        return settled((*x[:5], f, *x[6:]), y0).amplitude

    step = 1e-6 * x[5]
    quotient = (amplitude(x[5] + step) - amplitude(x[5] - step)) / (2.0 * step)
    assert jax.grad(amplitude)(x[5]) == pytest.approx(quotient, rel=1e-6)
    # What is known goes into further computations, and is a leaf of a pytree.
    doubled = jax.tree.map(lambda leaf: 2 * jnp.asarray(leaf), settled(x, y0))
    assert doubled.amplitude == 2.0 * amplitude(x[5])
