"""States of runs over time: under a harmonic for both models, and under a ground motion for the exact model.

The compiled code runs on the CPU (`tpd.compiled.calling`) and computes its own derivatives.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, Float

from tpd.compiled.calling import RUNS, shape
from tpd.compiled.derivatives import once
from tpd.compiled.rows import packed, row_of
from tpd.compiled.simulate import REST_RATES, accuracy, statuses_of
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import State
from tpd.scene.status import Status
from tpd.theory.equations import Terms

MOMENT = np.dtype(
    [
        *((name, np.float64) for name in ("tilt", "swing", "tilt_rate", "swing_rate")),
        *((name, np.float64) for name in ("tilt_pull", "swing_pull", "forcing", "kind", "side")),
    ]
)
"""State of a run at a time, as `tpd.compiled.legs.store_states` writes it: phi, psi, phi', psi', phi'' and
psi''; f times the forcing; the kind of the mode, and the side to which the block tilts."""
IMPACT = np.dtype([("time", np.float64), ("rate", np.float64)])
"""Time of an impact and the rate phi' after it."""


@jax.custom_jvp
def _trajectory(x: Array, y: Array, times: Array, settings: Array) -> tuple[Array, Array]:
    """Return the states at all times, and the status of the run."""
    out, status, _ = _trajectory_from(0.0, x, y, times, settings)
    return out[:, :4], status


def _trajectory_from(slopes: float, x: Array, y: Array, times: Array, settings: Array) -> Any:
    """Call the compiled code. `slopes` is 0 without derivatives, otherwise 1."""
    entry = RUNS.entry()
    n = times.size
    shapes = shape(n, 8), shape(1), shape(n if slopes else 1, 4, entry.INPUTS + 1)
    with_slopes = settings.at[entry.SETTINGS.names.index("slopes")].set(slopes)
    return RUNS(shapes, with_slopes, x, y, times)


_trajectory_with_slopes = once(partial(_trajectory_from, 1.0))


@_trajectory.defjvp
def _trajectory_jvp(primals: tuple, tangents: tuple) -> tuple:
    out, status, by = _trajectory_with_slopes(*primals)
    x, y, times, _ = tangents
    moved = by @ jnp.concatenate([x, y, times[:1]])
    # The first time is the start of the run: it shifts the run, but not the state at that time.
    rates = jnp.where(jnp.isfinite(out[:, 4:]), out[:, 4:], 0.0)
    later = rates * times.at[0].set(0.0)[:, None]
    return (out[:, :4], status), (moved + later, jnp.zeros_like(status))


def trajectory(
    equations: Terms, p: Parameters, y0: State, times: Float[Array, "times"], **limits: Any
) -> tuple[Float[Array, "times 4"], Status]:
    """Return the states of a run under a harmonic at `times`, and its status.

    The run starts from `y0` at `times[0]`.

    Args:
        equations: linear or nonlinear.
        p: parameters.
        y0: initial state (phi, psi, phi', psi').
        times: increasing times (tau).
        limits: settings by their names: events, rest_rate, and rtol for the nonlinear model.
    """
    settings = {**accuracy(equations), **limits}
    s = packed(RUNS.settings("TRAJECTORY", periods=times.size, **settings))
    ys, status = _trajectory(jnp.asarray(row_of(p)), jnp.asarray(y0), times, s)
    (code,) = stop_gradient(status)
    return ys, statuses_of(code)


def history(
    row: np.ndarray, y0: np.ndarray, pieces: np.ndarray, times: np.ndarray, *, free: float, events: int
) -> tuple[np.ndarray, np.ndarray, Status]:
    """Simulate a run through a ground motion, and return its states, its impacts and its status.

    The run passes through all pieces and then moves freely. The states are records `MOMENT` at the requested
    times, NaN after the end of a run that failed, and the impacts are records `IMPACT`.

    Args:
        row: parameters (10,).
        y0: initial state (4,).
        pieces: pieces of the ground motion.
        times: increasing times (tau) of the states.
        free: duration of the free motion (tau).
        events: bound on the number of events, in addition to one for each piece.
    """
    states, status = np.empty(len(times), MOMENT), np.empty(1)
    # No run has more impacts, because each impact is one of its events.
    impacts = np.empty(len(pieces) + events, IMPACT)
    sizes = {"periods": len(times), "impacts": len(impacts), "pieces": len(pieces), "events": events}
    options = {"free": free, "rest_rate": REST_RATES[Terms.linear], **accuracy(Terms.linear)}
    settings = RUNS.settings("HISTORY", **sizes, **options)
    # The equations contain minus the acceleration of the base.
    operands = row, y0, np.ascontiguousarray(-pieces), times
    RUNS.entry().run(0, 1, np.array(settings), *operands, states, impacts, status)
    return states, impacts[np.isfinite(impacts["time"])], statuses_of(status[0])
