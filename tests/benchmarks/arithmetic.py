"""How much arithmetic a function holds, and what that costs where nothing else does."""

import collections
import statistics
import time

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend import core

KINDS = {
    **dict.fromkeys(
        ("add", "sub", "mul", "neg", "max", "min", "abs", "sign", "round", "integer_pow"), "plain"
    ),
    **dict.fromkeys(
        ("select_n", "eq", "ne", "lt", "le", "gt", "ge", "and", "or", "not", "is_finite"), "choice"
    ),
    **dict.fromkeys(("div", "rem"), "division"),
    "sqrt": "root",
    **dict.fromkeys(("exp", "expm1", "cosh", "sinh"), "exponential"),
    **dict.fromkeys(("sin", "cos", "tan", "atan2", "log", "acos", "asinh", "acosh", "pow"), "library call"),
}
TRIPS = 3
"""Assumed of a loop whose length is not known: those of Newton's method at the end of a search."""
LENGTH = 512


def count(function, *args):
    """Operations on single numbers, by kind; the work of all turns of all loops together."""
    total = collections.Counter()
    _walk(jax.make_jaxpr(function)(*args).jaxpr, 1, total)
    return total


def _walk(jaxpr, times, total):
    for eqn in jaxpr.eqns:
        name = eqn.primitive.name
        turns = times * {"scan": eqn.params.get("length", 1), "while": TRIPS}.get(name, 1)
        inner = [jaxpr for value in eqn.params.values() for jaxpr in _jaxprs(value)]
        for each in inner:
            _walk(each, turns, total)
        if not inner and name in KINDS:
            size = max(int(np.prod(v.aval.shape)) for v in eqn.outvars)
            weight = 2 if name == "integer_pow" and eqn.params["y"] > 2 else 1
            total[KINDS[name]] += times * size * weight
        elif name == "dot_general":
            ((left, _), _) = eqn.params["dimension_numbers"]
            depth = int(np.prod([eqn.invars[0].aval.shape[i] for i in left]))
            total["plain"] += times * 2 * depth * int(np.prod(eqn.outvars[0].aval.shape))


def _jaxprs(value):
    if isinstance(value, core.ClosedJaxpr):
        yield value.jaxpr
    elif isinstance(value, core.Jaxpr):
        yield value
    elif isinstance(value, (tuple, list)):
        for each in value:
            yield from _jaxprs(each)


def costs():
    """Seconds for one operation of each kind, in a loop over vectors that stay in the cache."""
    x = jnp.linspace(0.5, 1.5, LENGTH)
    return {kind: _cost(step, per, x) for kind, (step, per) in _STEPS.items()}


def _polynomial(y):
    for _ in range(32):
        y = y * 0.999 + 0.001
    return y


def _chosen(y):
    for i in range(16):
        y = jnp.where(y > 0.7 + 0.01 * i, y, 1.0 - y)
    return y


_STEPS = {
    "plain": (_polynomial, 64),
    "choice": (_chosen, 32),
    "division": (lambda y: 1.0 / (y + 0.1), 1),
    "root": (lambda y: jnp.sqrt(y + 0.1), 1),
    "exponential": (lambda y: jnp.exp(-y), 1),
    "library call": (lambda y: jnp.sin(y) + 0.5, 1),
}


def _cost(step, per, x, turns=4000):
    run = jax.jit(lambda x: jax.lax.fori_loop(0, turns, lambda _, y: step(y), x))
    run(x).block_until_ready()
    seconds = []
    for _ in range(5):
        begun = time.perf_counter()
        run(x).block_until_ready()
        seconds.append(time.perf_counter() - begun)
    return statistics.median(seconds) / (turns * per * LENGTH)
