"""The linear equations (25) by compiled scalar code: the exact motions of `Piecewise`, one after another.

A program of XLA executes a loop over many small numbers slowly, and takes long to compile. The code here is
compiled once for a machine and stored. It runs on the host's processor, under `jit`, `vmap` and derivatives
as `tpd.models.calling` says, with derivatives of its own; `settle_all` follows batches on all cores.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.exact.contact import Mode
from tpd.exact.derivatives import once
from tpd.exact.rows import packed, row_of
from tpd.exact.terms import ENDS
from tpd.models.base import Cycle, Settled
from tpd.models.calling import Compiled, numbers_in, parts, shape
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status, index_of

Limits = tuple[int, int, float, float, int]
"""Limits as `tpd.models.piecewise.Piecewise` has them."""
TRIAL = Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=2.0, rho=0.7, e=0.9)
"""Parameters of the motion that tells whether XLA can call the compiled code."""


def _trial(entry: Any) -> tuple[tuple[jax.ShapeDtypeStruct, ...], tuple[np.ndarray, ...]]:
    """A motion that is followed for one period."""
    limits = {"periods": 1.0, "events": 100.0, "rest_rate": 2e-7, "rtol": 1e-8}
    settings = np.array(entry.settings(task=entry.SETTLE, **limits))
    return (shape(numbers_in(entry.SETTLED)),), (settings, row_of(TRIAL), np.zeros(4), np.zeros(2))


EXACT = Compiled("tpd.models.exact_entry", "tpd_exact", "the linear equations", _trial)
"""The entrance to the compiled code of the linear equations."""
NONLINEAR = Compiled("tpd.models.nonlinear_entry", "tpd_nonlinear", "the nonlinear equations", _trial)
"""Entrance to that of the nonlinear equations, which has the tasks `SETTLE` and `SHAKE`."""


def settings_of(task: str, of: Compiled = EXACT, **values: Any) -> Array:
    """A row of settings, see `tpd.models.custom_call.FIELDS`."""
    entry = of.entry()
    row = entry.settings(task=getattr(entry, task), **values)
    return packed(row)


def changed(settings: Array, name: str, value: float) -> Array:
    """A row of settings with another value."""
    return settings.at[EXACT.entry().FIELDS.index(name)].set(value)


def _mode_of(of: Any) -> Mode:
    return Mode(of.kind.astype(int), of.tilt, of.way)


def _status_of(number: Array) -> Status:
    every = [getattr(Status, name) for name in ENDS]
    return jax.tree.map(lambda *x: jnp.stack(x)[number.astype(int)], *every)


def settle(p: Parameters, y0: State, *limits: Any, of: Compiled = EXACT) -> Settled:
    """Follow the motion from `y0` at tau = 0 until it repeats, rests or is lost, by the equations `of`; not
    differentiable. `limits` are the first four of `Piecewise`."""
    entry, names = of.entry(), ("periods", "events", "tolerance", "rest_rate")
    s = settings_of("SETTLE", of, rtol=1e-8, **dict(zip(names, limits, strict=True)))
    x, y = jax.lax.stop_gradient(row_of(p)), jax.lax.stop_gradient(y0)
    (out,) = of((shape(numbers_in(entry.SETTLED)),), s, x, y, jnp.zeros(2))
    return settled_of(out, entry.SETTLED)


def settled_of(numbers: Any, record: np.dtype) -> Settled:
    """Motions as they have settled, from the records of compiled code as floats."""
    of, index = parts(numbers, record), np.array([index_of(name) for name in ENDS], dtype=np.int32)
    kind, code, periods, elapsed = (x.astype(int) for x in (of.kind, of.status, of.periods, of.elapsed))
    status = index[code] if isinstance(code, np.ndarray) else jnp.asarray(index)[code]
    # From its leaves, because fields are annotated with the shapes of a single motion.
    sizes, peaks = (of.amplitude, of.stroke), (of.peak, of.peak_stroke)
    leaves = [of.y, kind, of.tilt, of.way, periods, *sizes, status, elapsed, *peaks]
    return jax.tree.unflatten(_structure(), leaves)


@lru_cache(maxsize=1)
def _structure() -> Any:
    """Structure of the pytree of a `Settled`."""
    none, count = jnp.zeros(()), jnp.zeros((), int)
    about = count, none, none, Status.failed, count, none, none
    return jax.tree.structure(Settled(jnp.zeros(4), Mode(count, none, none), *about))


def solve(x: Any, y0: Any, limits: Limits) -> Any:
    """The steady state of a motion: its numbers in the order of `tpd.exact.steady.STEADY`.

    Args:
        x, y0: parameters as `row_of` has them, and the state at tau = 0. Of NumPy's arrays the answer is one
            as well, and no program of JAX is asked.
        limits: those of `Piecewise`.
    """
    entry, row, n = _asked(limits)
    if not (isinstance(x, np.ndarray) and isinstance(y0, np.ndarray)):
        (out,) = EXACT((shape(n),), row, x, y0)
        return out
    out = np.empty(n)
    entry.run(0, 1, row, np.ascontiguousarray(x, float), np.ascontiguousarray(y0, float), out)
    return out


@lru_cache(maxsize=8)
def _asked(limits: Limits) -> tuple[Any, np.ndarray, int]:
    """The module with the compiled code, a row of settings for `solve`, and how many numbers it gives."""
    entry, names = EXACT.entry(), ("periods", "events", "tolerance", "rest_rate", "lyapunov")
    row = np.array(entry.settings(task=entry.STEADY_STATE, **dict(zip(names, limits, strict=True))))
    return entry, row, numbers_in(entry.STEADY)


@jax.custom_jvp
def _cycle(x: Array, y: Array, mode: Array, settings: Array) -> Array:
    """The results of one run along a motion's periods."""
    return _cycle_from(x, y, mode, settings)[0]


def _cycle_from(x: Array, y: Array, mode: Array, settings: Array) -> tuple[Array, Array]:
    record = EXACT.entry().CYCLE
    (out,) = EXACT((shape(numbers_in(record)),), settings, x, y, mode)
    return out, parts(out, record).by


_cycle_with_slopes = once(_cycle_from)


@_cycle.defjvp
def _cycle_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    out, by = _cycle_with_slopes(*primals)
    x, y, *_ = tangents
    moved = by @ jnp.concatenate([x, y])
    return out, jnp.concatenate([moved, jnp.zeros(out.size - moved.size)])


def cycle(p: Parameters, settled: Settled, y: State, max_events: int, rest_rate: Number) -> Cycle:
    """Run the orbit's periods from `y`; derivatives pass through every event."""
    m = settled.memory
    s = settings_of("PERIODS", periods=settled.periods, events=max_events, rest_rate=rest_rate)
    mode = jnp.stack([jnp.asarray(v, dtype=jnp.float64) for v in (m.kind, m.tilt_sign, m.rate_sign)])
    out, record = _cycle(row_of(p), y, mode, s), EXACT.entry().CYCLE
    of, still = parts(out, record), parts(jax.lax.stop_gradient(out), record)
    rest = still.crossing, still.asymmetry, still.closed != 0.0
    return Cycle(of.end, of.amplitude, of.stroke, _mode_of(still), *rest)


@jax.custom_jvp
def _trajectory(x: Array, y: Array, times: Array, settings: Array) -> tuple[Array, Array]:
    """States at all times, and the status."""
    out, status, _ = _trajectory_from(0.0, x, y, times, settings)
    return out[:, :4], status


def _trajectory_from(slopes: float, x: Array, y: Array, times: Array, settings: Array) -> Any:
    entry = EXACT.entry()
    n = times.size
    shapes = shape(n, 8), shape(1), shape(n if slopes else 1, 4, entry.INPUTS + 1)
    return EXACT(shapes, changed(settings, "slopes", slopes), x, y, times)


_trajectory_with_slopes = once(partial(_trajectory_from, 1.0))


@_trajectory.defjvp
def _trajectory_jvp(primals: tuple, tangents: tuple) -> tuple:
    out, status, by = _trajectory_with_slopes(*primals)
    x, y, times, _ = tangents
    moved = by @ jnp.concatenate([x, y, times[:1]])
    # The first time moves the beginning of the motion, and no state at it.
    rates = jnp.where(jnp.isfinite(out[:, 4:]), out[:, 4:], 0.0)
    later = rates * times.at[0].set(0.0)[:, None]
    return (out[:, :4], status), (moved + later, jnp.zeros_like(status))


def trajectory(
    p: Parameters, y0: State, times: Float[Array, "times"], max_events: int, rest_rate: Number
) -> tuple[Float[Array, "times 4"], Status]:
    """The states at `times`, from `y0` at `times[0]`."""
    s = settings_of("TRAJECTORY", periods=times.size, events=max_events, rest_rate=rest_rate)
    ys, status = _trajectory(row_of(p), y0, times, s)
    (code,) = jax.lax.stop_gradient(status)
    return ys, _status_of(code)


def load_compiled() -> None:
    """Load the compiled code of both equations, or compile it where there is none on this machine."""
    EXACT.direct()
    NONLINEAR.entry()
