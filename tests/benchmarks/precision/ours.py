"""Methods of the package for the settled amplitude and its gradient."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tests.benchmarks.precision.methods import Method, Unable
from tests.benchmarks.precision.scenes import Scene
from tests.benchmarks.smoothing import Widths
from tests.reference import NAMES, parameters
from tpd import Parameters, Piecewise, Status, steady_state, symmetric_orbits
from tpd.theory import one_harmonic

SHARPNESS = (2e-2, 2e-3, 6e-4)
STEPS = (1e-3, 1e-5)
"""Step of the differences, divided by the parameter."""


def _number(x: Any) -> float:
    value = float(x)
    if not np.isfinite(value):
        raise Unable("no number")
    return value


def _slopes(gradient: Any, scene: Scene) -> np.ndarray:
    out = np.asarray(gradient)[list(scene.wrt)]
    if not np.all(np.isfinite(out)):
        raise Unable("refused")
    return out


def _attracting(x: jax.Array) -> jax.Array:
    """Return the largest amplitude of an attracting symmetric orbit, or NaN."""
    orbits = symmetric_orbits(parameters(x))
    return jnp.nanmax(jnp.where(orbits.status == Status.rocking, orbits.amplitude, jnp.nan))


_FROM_PARAMETERS = {"orbits": _attracting, "harmonic": lambda x: one_harmonic(parameters(x)).amplitude}
"""Functions of the parameters alone, for which forward derivatives are faster."""


@lru_cache
def _compiled(kind: str) -> tuple[Callable, Callable]:
    """Return value and gradient in a JAX program, as functions of (x, y0, sharpness)."""

    def amplitude(x: jax.Array, y0: jax.Array, sharpness: jax.Array) -> jax.Array:
        if kind in _FROM_PARAMETERS:
            return _FROM_PARAMETERS[kind](x)
        soft = Widths(shares=jnp.stack([sharpness, sharpness]), cycle_rtol=1e-10)
        return steady_state(parameters(x), model=soft if kind == "smoothed" else Piecewise(), y0=y0).amplitude

    return jax.jit(amplitude), jax.jit((jax.jacfwd if kind in _FROM_PARAMETERS else jax.grad)(amplitude))


def _arguments(scene: Scene, setting: float) -> tuple[jax.Array, ...]:
    return jnp.asarray(scene.x), jnp.asarray(scene.y0), jnp.asarray(setting)


def _both(kind: str) -> tuple[Callable, Callable]:
    """Return value and gradient of a model, as functions of a scene and a setting."""

    def value(scene: Scene, setting: float) -> Callable[[], float]:
        run, given = _compiled(kind)[0], _arguments(scene, setting)
        return lambda: _number(run(*given))

    def gradient(scene: Scene, setting: float) -> Callable[[], np.ndarray]:
        run, given = _compiled(kind)[1], _arguments(scene, setting)
        return lambda: _slopes(run(*given), scene)

    return value, gradient


def _from_python(scene: Scene, _: float) -> Callable[[], float]:
    given = dict(zip(NAMES, scene.x, strict=False))
    y0 = np.array(scene.y0)
    return lambda: _number(steady_state(Parameters(**given), y0=y0).amplitude)


def _differences(scene: Scene, share: float) -> Callable[[], np.ndarray]:
    """Return central differences of the exact amplitude, from Python."""

    def side(i: int, by: float) -> float:
        return _from_python(scene.moved(i, by), 0.0)()

    def work() -> np.ndarray:
        steps = [(i, share * scene.x[i]) for i in scene.wrt]
        return np.array([(side(i, h) - side(i, -h)) / (2.0 * h) for i, h in steps])

    return work


METHODS = (
    Method("steady_state of floats (default)", True, (0.0,), _from_python),
    Method("steady_state in jit (default)", True, (0.0,), *_both("events")),
    Method("orbit equation in jit", True, (0.0,), *_both("orbits")),
    Method("one harmonic in jit", True, (0.0,), *_both("harmonic")),
    Method("smoothed, Tsit5", True, SHARPNESS, *_both("smoothed")),
    Method("floats, differences", True, STEPS, None, _differences),
)
