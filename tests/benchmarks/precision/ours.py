"""The project's own ways to the settled amplitude and its gradient, as methods of the charts."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tests.benchmarks.precision.methods import Method, Scene, Unable
from tests.reference import parameters
from tpd import Piecewise, Segmented, Smoothed, Status, Terms, in_chunks, steady_state, symmetric_orbits
from tpd.models.base import AbstractModel
from tpd.models.compiled_linear import settle
from tpd.scene.parameters import as_arrays
from tpd.theory.equations import smoothed_rates

SAMPLES = 4096
"""Of the last period, among which the largest tilt of a plain simulation is looked for."""


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


def _attracting(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The largest amplitude of an attracting symmetric orbit, and whether there is one."""
    orbits = symmetric_orbits(parameters(x))
    good = orbits.status == Status.rocking
    best = jnp.argmax(jnp.where(good, orbits.amplitude, -1.0))
    return orbits.amplitude[best], good[best]


_orbit = jax.jit(_attracting)
_orbit_slopes = jax.jit(jax.jacfwd(_attracting, has_aux=True))


def orbit_value(scene: Scene, _: float) -> Callable[[], float]:
    """One scalar equation."""
    x = jnp.asarray(scene.x)

    def work() -> float:
        amplitude, there = _orbit(x)
        if not there:
            raise Unable("no such orbit")
        return float(amplitude)

    return work


def orbit_gradient(scene: Scene, _: float) -> Callable[[], np.ndarray]:
    """The implicit function theorem on it."""
    x = jnp.asarray(scene.x)

    def work() -> np.ndarray:
        gradient, there = _orbit_slopes(x)
        if not there:
            raise Unable("no such orbit")
        return _slopes(gradient, scene)

    return work


@lru_cache
def _along(wrt: tuple[int, ...]) -> Callable:
    def slopes(x: jax.Array) -> jax.Array:
        return jax.jacfwd(lambda some: _attracting(x.at[jnp.array(wrt)].set(some))[0])(x[jnp.array(wrt)])

    return slopes


def orbit_batch(xs: np.ndarray, y0s: np.ndarray, wrt: tuple[int, ...], _: float) -> Callable[[], np.ndarray]:
    """Chunks on all cores."""
    del y0s
    return lambda: np.asarray(in_chunks(_along(wrt), xs))


@lru_cache
def _steady(model: AbstractModel) -> tuple[Callable, Callable]:
    def amplitude(x: jax.Array, y0: jax.Array) -> jax.Array:
        return steady_state(parameters(x), model=model, y0=y0).amplitude

    return jax.jit(amplitude), jax.jit(jax.grad(amplitude))


def steady_value(model: Callable[[float], AbstractModel]) -> Callable:
    """`steady_state` of a model with a setting."""

    def value(scene: Scene, setting: float) -> Callable[[], float]:
        run, x, y0 = _steady(model(setting))[0], jnp.asarray(scene.x), jnp.asarray(scene.y0)
        return lambda: _number(run(x, y0))

    return value


def steady_gradient(model: Callable[[float], AbstractModel]) -> Callable:
    """Its derivative, by the implicit function theorem on the period map."""

    def gradient(scene: Scene, setting: float) -> Callable[[], np.ndarray]:
        run, x, y0 = _steady(model(setting))[1], jnp.asarray(scene.x), jnp.asarray(scene.y0)
        return lambda: _slopes(run(x, y0), scene)

    return gradient


def by_differences(scene: Scene, share: float) -> Callable[[], np.ndarray]:
    """Central differences of the exact amplitude over a share of each parameter."""
    run, y0 = _steady(Piecewise())[0], jnp.asarray(scene.y0)

    def work() -> np.ndarray:
        out = []
        for i in scene.wrt:
            step = share * scene.x[i]
            sides = [_number(run(jnp.asarray(scene.moved(i, way * step).x), y0)) for way in (1.0, -1.0)]
            out.append((sides[0] - sides[1]) / (2.0 * step))
        return np.array(out)

    return work


@lru_cache
def _through(periods: int) -> Callable:
    model = Piecewise(lyapunov_periods=0)

    def amplitude(x: jax.Array, y0: jax.Array) -> jax.Array:
        p = as_arrays(parameters(x))
        begun = settle(p, y0, 0, model.max_events, model.tolerance, model.rest_rate)
        many = eqx.tree_at(lambda s: s.periods, begun, jnp.asarray(periods))
        transient = model.cycle(p, many, y0)
        last = eqx.tree_at(lambda s: (s.periods, s.memory), begun, (jnp.asarray(1), transient.memory))
        return model.cycle(p, last, transient.end).amplitude

    return jax.jit(jax.jacfwd(amplitude))


def whole_run(scene: Scene, periods: float) -> Callable[[], np.ndarray]:
    """Forward mode through so many periods of the exact solution, then one more for the amplitude."""
    run, x, y0 = _through(int(periods)), jnp.asarray(scene.x), jnp.asarray(scene.y0)
    return lambda: _slopes(run(x, y0), scene)


@lru_cache
def _simulated(sharpness: float, periods: int, reverse: bool) -> Callable:
    """The gradient of the largest tilt in the last of so many smoothed periods, solved in one go."""
    model = Smoothed(sharpness=sharpness)

    def amplitude(x: jax.Array, y0: jax.Array) -> jax.Array:
        p = as_arrays(parameters(x))
        last = (periods - 1.0 + jnp.linspace(0.0, 1.0, SAMPLES)) * p.period
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(smoothed_rates(p, *model.widths(p), Terms.linear)),
            diffrax.Tsit5(),
            0.0,
            periods * p.period,
            1e-3 * p.period,
            y0,
            saveat=diffrax.SaveAt(ts=last),
            stepsize_controller=diffrax.PIDController(rtol=1e-8, atol=1e-10),
            adjoint=diffrax.RecursiveCheckpointAdjoint() if reverse else diffrax.ForwardMode(),
            max_steps=1 << 17,
            throw=False,
        )
        return jnp.max(jnp.abs(solution.ys[:, 0]))

    return jax.jit(jax.grad(amplitude) if reverse else jax.jacfwd(amplitude))


def simulated_gradient(reverse: bool) -> Callable:
    """Through 60 smoothed periods, in one of the two modes."""

    def gradient(scene: Scene, sharpness: float) -> Callable[[], np.ndarray]:
        run, x, y0 = _simulated(sharpness, 60, reverse), jnp.asarray(scene.x), jnp.asarray(scene.y0)
        return lambda: _slopes(run(x, y0), scene)

    return gradient


def _smoothed(solver: diffrax.AbstractSolver) -> Callable[[float], Smoothed]:
    return lambda sharpness: Smoothed(sharpness=sharpness, solver=solver, cycle_rtol=1e-10)


def _segmented(rtol: float) -> Segmented:
    return Segmented(terms=Terms.linear, rtol=rtol, cycle_rtol=1e-2 * rtol, tolerance=max(1e-6, 10.0 * rtol))


_SHARPNESS = (2e-2, 6e-3, 2e-3, 6e-4)

OURS = (
    Method("orbit equation (default)", True, "none", (0.0,), orbit_value, orbit_gradient, orbit_batch),
    Method(
        "events, then Newton (default)",
        True,
        "none",
        (0.0,),
        steady_value(lambda _: Piecewise()),
        steady_gradient(lambda _: Piecewise()),
    ),
    Method(
        "nonlinear model's segments, linear terms",
        True,
        "rtol",
        (1e-4, 1e-6, 1e-8),
        steady_value(_segmented),
        steady_gradient(_segmented),
    ),
    *(
        Method(
            f"smoothed, {type(solver).__name__}",
            True,
            "sharpness",
            _SHARPNESS,
            steady_value(_smoothed(solver)),
            steady_gradient(_smoothed(solver)),
        )
        for solver in (diffrax.Tsit5(), diffrax.Dopri8(), diffrax.Kvaerno5())
    ),
    Method("events, differences", True, "step", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6), None, by_differences),
    Method("events, forward through the run", True, "periods", (10.0, 30.0, 100.0), None, whole_run),
    Method(
        "smoothed, forward through the run",
        True,
        "sharpness",
        _SHARPNESS[:3],
        None,
        simulated_gradient(False),
    ),
    Method(
        "smoothed, reverse with checkpoints",
        True,
        "sharpness",
        _SHARPNESS[:3],
        None,
        simulated_gradient(True),
    ),
)
