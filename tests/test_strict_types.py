"""JAX may be strict about types (`jax_numpy_dtype_promotion`): the package mixes none without saying so."""

from functools import partial

import jax
import numpy as np
import pytest

import tpd
from tests.design.test_search import LIMITED as PROBLEM
from tests.design.test_search import descended

P = tpd.Parameters(nu=0.2, mu=0.05, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=4.0)
BLOCK = tpd.Block(width=1.0, height=5.0, mass=9000.0)
PULSE = tpd.Pulse.one_sine(acceleration=4.0, frequency=1.0)


def tilt_of(block):
    return tpd.transient(tpd.Scene(block, PULSE)).tilt


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
    "descent": lambda: descended(PROBLEM, tpd.Descent(steps=2)),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_call_is_possible_with_strict_type_promotion_of_jax(name):
    with jax.numpy_dtype_promotion("strict"):
        CALLS[name]()
