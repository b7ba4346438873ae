"""JAX may be strict about types (`jax_numpy_dtype_promotion`): the package mixes none without saying so."""

from functools import partial

import jax
import numpy as np
import pytest

import tpd
from tests.design.minimax import LIMITED, STARTS, WORST
from tpd.design.orbits import SMOOTHED
from tpd.design.search import descend
from tpd.models.half_period import half_period, remaining
from tpd.scene.conditions import FACTORS
from tpd.scene.parameters import as_arrays

P = tpd.Parameters(nu=0.2, mu=0.05, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=4.0)
BLOCK = tpd.Block(width=1.0, height=5.0, mass=9000.0)
PULSE = tpd.Pulse.one_sine(acceleration=4.0, frequency=1.0)


def tilt_of(block):
    return tpd.transient(tpd.Scene(block, PULSE)).tilt


def descended(optimiser):
    return descend(optimiser, LIMITED, STARTS, LIMITED(STARTS), 1.0, WORST, steps=2)


ORBIT = as_arrays(P), np.array([0.05, 0.5, 0.1]), np.ones(len(FACTORS)), np.array([0.05, 0.1, 0.3, 0.1])


def trace(function, *inputs):
    """Trace a function, which compiles nothing. Types are checked while a function is traced."""
    jax.eval_shape(function, *inputs)


CALLS = {
    "steady state, smoothed": lambda: trace(partial(tpd.steady_state, model=tpd.Smoothed()), P),
    "steady state, chosen": lambda: tpd.steady_state(P, model=tpd.Auto()),
    "derivatives of orbits": lambda: trace(jax.jacfwd(lambda p: tpd.symmetric_orbits(p).amplitude), P),
    "orbits, in reverse": lambda: trace(jax.jacrev(lambda p: tpd.symmetric_orbits(p).amplitude), P),
    "periodic orbit": lambda: tpd.periodic_orbit(P, np.array([0.05, 0.0, 0.0, 0.0])),
    "derivatives of a transient": lambda: trace(jax.grad(tilt_of), BLOCK),
    "critical scale": lambda: tpd.critical_scale(tpd.Scene(BLOCK, PULSE)),
    "harmonic balance": lambda: trace(tpd.theory.one_harmonic_branches, P),
    "fold of the balance": lambda: trace(tpd.theory.fold, P),
    "parametric balance": lambda: trace(tpd.theory.parametric_branches, P),
    "neglected harmonics": lambda: trace(tpd.theory.neglected_harmonics, P),
    "descent": lambda: [descended(optimiser) for optimiser in ("newton", "adam")],
    "half period": lambda: trace(half_period(SMOOTHED), ORBIT),
    "disturbances": lambda: trace(remaining(SMOOTHED), (*ORBIT, np.ones((4, 3)))),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_call_is_possible_with_strict_type_promotion_of_jax(name):
    with jax.numpy_dtype_promotion("strict"):
        CALLS[name]()
