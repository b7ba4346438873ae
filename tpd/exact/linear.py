"""The linear equations (25) by compiled scalar code: the exact motions of `Piecewise`, one after another.

A program of XLA executes a loop over many small numbers slowly, and takes long to compile. The code here is
compiled once for a machine and stored. It runs on the host's processor, under `jit`, `vmap` and derivatives
as `tpd.exact.calling` says, with derivatives of its own. Runs that settle are followed by `tpd.exact.runs`.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from tpd.exact.calling import LINEAR, numbers_in, parts, shape
from tpd.exact.contact import Mode
from tpd.exact.derivatives import once
from tpd.exact.rows import packed, row_of
from tpd.exact.runs import REST_RATES, Settled
from tpd.exact.terms import ENDS
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

MOMENT = np.dtype(
    [
        *((name, np.float64) for name in ("tilt", "swing", "tilt_rate", "swing_rate")),
        *((name, np.float64) for name in ("tilt_pull", "swing_pull", "forcing", "kind", "side")),
    ]
)
"""State of a run at a time, as `tpd.exact.legs.put_states` has it: phi, psi, phi', psi', phi'' and psi''; f
times the forcing; kind of its mode, and the side to which the block leans."""
IMPACT = np.dtype([("time", np.float64), ("rate", np.float64)])
"""Time of an impact and the rate phi' after it."""
Limits = tuple[int, int, float, float, int]
"""Limits as `tpd.models.piecewise.Piecewise` has them."""


class Cycle(eqx.Module):
    """One period of a motion, differentiable in forward mode."""

    end: State
    amplitude: Number
    stroke: Number
    memory: Any
    """As `Settled.memory`, at the end."""
    transversality: Number
    """Least rate at which the motion met an event, over the usual rate: 0 if it grazed one, infinite for a
    model without events."""
    asymmetry: Number
    """Difference between the largest tilts to either side, over the amplitude."""
    closed: Bool[Array, ""]
    """Whether the discrete mode at the end is that at the beginning; true for a model without modes."""


def _status_of(number: Array) -> Status:
    every = [getattr(Status, name) for name in ENDS]
    return jax.tree.map(lambda *x: jnp.stack(x)[number.astype(int)], *every)


def solve(x: Any, y0: Any, limits: Limits) -> Any:
    """The steady state of a motion: its numbers in the order of `tpd.exact.steady.STEADY`.

    Args:
        x, y0: parameters as `row_of` has them, and the state at tau = 0. Of NumPy's arrays the answer is one
            as well, and no program of JAX is asked.
        limits: those of `Piecewise`.
    """
    entry, row, n = _asked(limits)
    if not (isinstance(x, np.ndarray) and isinstance(y0, np.ndarray)):
        (out,) = LINEAR((shape(n),), row, x, y0)
        return out
    out = np.empty(n)
    entry.run(0, 1, row, np.ascontiguousarray(x, float), np.ascontiguousarray(y0, float), out)
    return out


@lru_cache(maxsize=8)
def _asked(limits: Limits) -> tuple[Any, np.ndarray, int]:
    """The module with the compiled code, a row of settings for `solve`, and how many numbers it gives."""
    entry, names = LINEAR.entry(), ("periods", "events", "tolerance", "rest_rate", "lyapunov")
    row = np.array(LINEAR.settings("STEADY_STATE", **dict(zip(names, limits, strict=True))))
    return entry, row, numbers_in(entry.STEADY)


@jax.custom_jvp
def _cycle(x: Array, y: Array, mode: Array, settings: Array) -> Array:
    """The results of one run along a motion's periods."""
    return _cycle_from(x, y, mode, settings)[0]


def _cycle_from(x: Array, y: Array, mode: Array, settings: Array) -> tuple[Array, Array]:
    record = LINEAR.entry().CYCLE
    (out,) = LINEAR((shape(numbers_in(record)),), settings, x, y, mode)
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
    limits = {"periods": settled.periods, "events": max_events, "rest_rate": rest_rate}
    s = packed(LINEAR.settings("PERIODS", **limits))
    mode = jnp.stack([jnp.asarray(v, dtype=jnp.float64) for v in (m.kind, m.tilt_sign, m.rate_sign)])
    out, record = _cycle(jnp.asarray(row_of(p)), y, mode, s), LINEAR.entry().CYCLE
    of, still = parts(out, record), parts(jax.lax.stop_gradient(out), record)
    mode = Mode(still.kind.astype(int), still.tilt, still.way)
    rest = still.crossing, still.asymmetry, still.closed != 0.0
    return Cycle(of.end, of.amplitude, of.stroke, mode, *rest)


@jax.custom_jvp
def _trajectory(x: Array, y: Array, times: Array, settings: Array) -> tuple[Array, Array]:
    """States at all times, and the status."""
    out, status, _ = _trajectory_from(0.0, x, y, times, settings)
    return out[:, :4], status


def _trajectory_from(slopes: float, x: Array, y: Array, times: Array, settings: Array) -> Any:
    entry = LINEAR.entry()
    n = times.size
    shapes = shape(n, 8), shape(1), shape(n if slopes else 1, 4, entry.INPUTS + 1)
    asked = settings.at[entry.FIELDS.index("slopes")].set(slopes)
    return LINEAR(shapes, asked, x, y, times)


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
    limits = {"periods": times.size, "events": max_events, "rest_rate": rest_rate}
    s = packed(LINEAR.settings("TRAJECTORY", **limits))
    ys, status = _trajectory(jnp.asarray(row_of(p)), y0, times, s)
    (code,) = jax.lax.stop_gradient(status)
    return ys, _status_of(code)


class History(NamedTuple):
    """A run under a ground motion over time."""

    states: np.ndarray
    """Records `MOMENT` at the times asked for, NaN after the end of a run without an answer."""
    impacts: np.ndarray
    """Records `IMPACT` of all impacts."""
    status: int
    """Index among `tpd.exact.terms.SHAKEN`."""


def history(
    row: np.ndarray, y0: np.ndarray, pieces: np.ndarray, times: np.ndarray, *, free: float, events: int
) -> History:
    """Follow a run through the pieces of a ground motion, and freely for `free` (tau), and return its states
    at increasing times and its impacts; at most so many events beyond one for each piece."""
    states, status = np.empty(len(times), MOMENT), np.empty(1)
    # No run has more: each impact is one of its events.
    impacts = np.empty(len(pieces) + events, IMPACT)
    sizes = {"periods": len(times), "impacts": len(impacts), "pieces": len(pieces), "events": events}
    settings = LINEAR.settings("HISTORY", **sizes, free=free, rest_rate=REST_RATES[Terms.linear])
    # The equations have minus the acceleration of the base.
    given = row, y0, np.ascontiguousarray(-pieces), times
    LINEAR.entry().run(0, 1, np.array(settings), *given, states, impacts, status)
    return History(states, impacts[np.isfinite(impacts["time"])], int(status.item()))
