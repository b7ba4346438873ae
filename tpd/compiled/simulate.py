"""Runs of the linear model and of the nonlinear model: `follow` and `solve_steady`.

Runs of NumPy arrays are computed at once, a batch on all cores. JAX may also trace a single run. The compiled
code runs on the CPU (`tpd.compiled.calling`) and computes its own derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.lax import stop_gradient
from jaxtyping import Array

from tpd.compiled.calling import RUNS, parts, shape
from tpd.compiled.columns import RUN, STEADY, TILT_PULL, TILT_RATE, WIDTH, XI
from tpd.compiled.derivatives import moved, once
from tpd.compiled.rows import packed
from tpd.core import checks
from tpd.scene.parameters import NAMES
from tpd.scene.status import Status, status_of
from tpd.theory.equations import Terms

TOLERANCE = 1e-6
"""Default difference between two periods that counts as settled, relative to
`tpd.compiled.repetition.scales_of`."""
_SETTLED, _LOOSEST = 100.0, 1e-4
"""Under the nonlinear model the difference is this multiple of the tolerance of a step, at least
`TOLERANCE`, and at most the second number, which changed no outcome of 4 096 runs."""
EXACT = 1e-13
"""Relative tolerance of a step of the linear model. The errors are then rounding errors."""
REST_RATES = {Terms.linear: 2e-7, Terms.nonlinear: 1e-4}
"""Default rate |phi'|/nu below which an impact ends in rest, if the block can then be held."""
PERIODS = {Terms.linear: 500, Terms.nonlinear: 400}
"""Default bounds on the forcing periods of a run."""
EVENTS = 2000
"""Default bound on the events of a forcing period."""
GROUND_EVENTS = {Terms.linear: 200_000, Terms.nonlinear: 100_000}
"""Default bounds on the events of a run under a ground motion, in addition to one event for each piece."""
_AT_END = 1e-12
"""Relative difference of two times that are equal except for rounding."""
ANGLES, END, TIMES = slice(0, 3), slice(3, 8), slice(8, 12)
"""Rows of the derivatives of a run: the three largest angles; the state at the end and the growing
coordinate; the times of the angles and of the first uplift."""


class HarmonicForcing(NamedTuple):
    """Harmonic excitation of runs that are simulated until they repeat, rest or overturn.

    Each field is a number for all runs or an array (n,), except `periods`.
    """

    periods: int | None = None
    """Largest number of forcing periods of a run. The default is that of `PERIODS`."""
    begin: Any = 0.0
    """Dimensionless times at which the excitation and the run begin, within the first forcing period."""
    ramp: Any = 0.0
    """Number of forcing periods over which the excitation grows linearly to its full size.

    The growth starts at tau = 0, also for runs that begin later. The default 0 is a sudden start.
    """


class GroundForcing(NamedTuple):
    """Ground motions of runs. A run passes through all pieces of a ground motion and then moves freely."""

    records: Sequence[Any]
    """Pieces of each ground motion, as `GroundMotion.pieces` returns them. They are not copied for
    each run."""
    free: Any
    """Duration of the free motion after the ground motion (tau), a number or an array (n,)."""
    which: Any = 0
    """Index into `records` for each run."""


class Run(NamedTuple):
    """Results of a run, or of a batch of runs: numbers of shape (...).

    Angles are in rad and times in tau. All angles are infinite if the block overturns. A batch has NumPy
    arrays, and a single run has JAX arrays or NumPy numbers. A field that the run does not have is NaN, or
    None for the models that are JAX programs.
    """

    tilt: Any
    """Largest |phi| of the whole run."""
    settled_tilt: Any
    """Largest |phi| of the last periods; under a ground motion that of the whole run."""
    swing: Any
    """Largest |psi| of the whole run."""
    settled_swing: Any
    """Largest |psi| of the last periods; under a ground motion that of the whole run."""
    rod_angle: Any
    """Largest |psi - phi|, the angle between rod and block. Under a harmonic the sum of tilt and swing, an
    upper bound."""
    settled_rod_angle: Any
    """Largest |psi - phi| of the last periods, with the same bound under a harmonic."""
    state: Any
    """State (phi, psi, phi', psi') at the end, shape (..., 4). Under a harmonic a whole number of forcing
    periods has passed since tau = 0. The state serves as initial guess for a periodic orbit."""
    status: Status
    """Outcome of the run."""
    periods: Any
    """Number of forcing periods in one period of the motion."""
    elapsed: Any
    """Number of forcing periods that were simulated."""
    times: Any = None
    """Times of the largest tilt, swing and rod angle, shape (..., 3)."""
    impacts: Any = None
    """Number of impacts."""
    growing: Any = None
    """Growing coordinate of the last arc at its start. It is 0 on the border between overturning and falling
    back."""
    uplift_time: Any = None
    """Time of the first uplift. It is infinite if the block stays on its base."""
    overturning_time: Any = None
    """Time from which the tilt is beyond return. It is infinite if the block does not overturn."""
    transversality: Any = None
    """Smallest rate at which the run crossed an event, divided by the usual rate."""


def accuracy(equations: Terms, rtol: Any = EXACT) -> dict[str, Any]:
    """Return the settings for the equations and the relative tolerance of a step.

    The tolerance counts for the nonlinear model only.
    """
    # The compiled code has one number for the equations, and a tolerance for both.
    linear = equations is Terms.linear
    return {"linear": float(linear), "rtol": EXACT if linear else checks.tolerance("rtol", rtol)}


class SteadyNumbers(NamedTuple):
    """Numbers of a `tpd.answers.steady_state.Steady`, in the order of its fields."""

    amplitude: Any
    swing: Any
    status: Any
    periods: Any
    multiplier: Any
    symmetric: Any
    lyapunov: Any
    state: Any
    elapsed: Any
    estimate: Any = math.nan


def run_of(numbers: Any) -> Run:
    """Return a run, or a batch of runs, from records `RUN` of compiled code, or from their numbers."""
    of = vars(parts(numbers, RUN))
    periods, elapsed = of.pop("periods").astype(int), of.pop("elapsed").astype(int)
    state, status = of.pop("state")[..., :TILT_PULL], statuses_of(of.pop("status"))
    return Run(**of, state=state, status=status, periods=periods, elapsed=elapsed)


def statuses_of(numbers: Any) -> Status:
    """Return the statuses whose numbers in compiled code are given as floats."""
    return status_of(numbers.astype(np.int32))


def follow(
    equations: Terms,
    rows: Any,
    forcing: HarmonicForcing | GroundForcing,
    *,
    y0: Any = None,
    rest_rate: Any = None,
    events: int | None = None,
    tolerance: Any = None,
    rtol: Any = 1e-8,
    brief: bool = False,
    parameters: int = WIDTH,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Run:
    """Simulate a run, or a batch of runs.

    Args:
        equations: linear or nonlinear. Runs of the nonlinear model have no derivatives (NaN). There every
            landing is an impact, and a run that does not repeat is `not_settled`.
        rows: parameters as in `tpd.compiled.rows`, shape (10,) for one run, or (n, 10) for a batch. JAX may
            trace the parameters of one run.
        forcing: a harmonic or ground motions.
        y0: initial states (4,) or (n, 4). The default is at rest. With (n, 4) a single row of parameters
            serves all runs of the batch.
        rest_rate: speed (|phi'| in units of nu) below which an impact ends in rest, if the block can then be
            held. The default is one of `REST_RATES`.
        events: bound on the events of a forcing period, by default `EVENTS`. Under a ground motion it is the
            bound on the events of the run, in addition to one event for each piece, by default one of
            `GROUND_EVENTS`.
        tolerance: difference between two periods that counts as settled, by default `TOLERANCE`. If the steps
            of the nonlinear model is less accurate, it is larger in proportion, up to 1e-4.
        rtol: relative tolerance of a step of the nonlinear model.
        brief: whether free motion after a ground motion may end as soon as it cannot tilt the block further.
            Then only tilt, uplift and overturning are valid. This option is for the linear model.
        parameters: number of parameters with derivatives in a traced run under a ground motion. The last one,
            the height of the hinge, is rarely needed, and every derivative costs time.
        workers: number of threads for a batch, by default one for each core.
        progress: function that is called from time to time with (runs done, number of runs), for a batch.

    Returns:
        The results. A batch gives leaves of leading axis n.

        One run of the linear model under a ground motion has exact derivatives in the parameters, the
        pieces, the free time and the initial state: those of the angles, of their times, of the time of the
        first uplift, of the state and of the growing coordinate. A derivative that does not exist is NaN, and
        so is that of the time of overturning. A run under a harmonic has no derivatives.

    Raises:
        ValueError: the batch is empty, arrays have different lengths, a number is out of range, or `workers`
            is less than one.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    limits = {"rest_rate": REST_RATES[equations] if rest_rate is None else rest_rate}
    limits |= accuracy(equations, rtol)
    settled = max(TOLERANCE, min(_SETTLED * limits["rtol"], _LOOSEST))
    if isinstance(forcing, GroundForcing):
        limits["events"] = GROUND_EVENTS[equations] if events is None else events
    else:
        limits |= {"events": EVENTS if events is None else events}
        limits["tolerance"] = settled if tolerance is None else tolerance
        limits["periods"] = PERIODS[equations] if forcing.periods is None else forcing.periods
    is_batch = np.ndim(rows) > 1 or np.ndim(y0) > 1
    # Without tracing, even one run is computed as a batch: otherwise JAX would compile a program for it.
    if is_batch or all(map(checks.is_concrete, jax.tree.leaves((rows, y0, forcing, limits)))):
        starts, wide = _batch_of(rows, y0)
        if isinstance(forcing, GroundForcing):
            table, places = _table_of(forcing)
            limits |= {"task": RUNS.entry().GROUND, "brief": brief, **places}
        else:
            table = _times_of(forcing, wide)
            limits |= {"task": RUNS.entry().SETTLE}
        # Settings are numbers or arrays (n,).
        settings: Any = np.zeros(len(wide), RUNS.entry().SETTINGS)
        for name, value in limits.items():
            settings[name] = value
        results = np.zeros(len(wide), RUN)
        RUNS.in_threads(len(wide), workers, progress, settings, wide, starts, table, results)
        runs = run_of(results)
        return runs if is_batch else jax.tree.map(lambda x: x[0, ...], runs)
    # JAX traces the run. It becomes one call of the compiled code within the program.
    start = jnp.zeros(4) if y0 is None else y0
    if isinstance(forcing, GroundForcing):
        return _trace_ground_run(rows, start, forcing, limits, parameters)
    row, times = packed(RUNS.settings("SETTLE", **limits)), packed((forcing.begin, forcing.ramp))
    (out,) = RUNS((shape(RUN),), row, stop_gradient(rows), stop_gradient(start), times)
    return run_of(out)


def _batch_of(rows: Any, y0: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the initial states (n, 4) and the parameters (n, 10) of a batch. A single row is repeated."""
    rows = np.atleast_2d(rows)
    starts = np.zeros((len(rows), 4)) if y0 is None else np.array(y0, dtype=float, order="C", ndmin=2)
    n, width = len(starts), len(NAMES)
    if n == 0 or starts.shape != (n, 4) or rows.shape not in ((1, width), (n, width)):
        shapes = f"{rows.shape} and {starts.shape}"
        raise ValueError(f"`rows` must have shape (n, {width}) and `y0` (n, 4), but have {shapes}")
    return starts, np.ascontiguousarray(np.broadcast_to(rows, (n, width)), dtype=float)


def _times_of(forcing: HarmonicForcing, rows: np.ndarray) -> np.ndarray:
    """Return the beginnings and the ramps of runs, shape (n, 2)."""
    n, operands = len(rows), (forcing.begin, forcing.ramp)
    if shapes := {np.shape(x) for x in operands} - {(), (n,)}:
        raise ValueError(f"`begin` and `ramp` must have shape ({n},), but have {shapes}")
    times = np.stack([np.broadcast_to(np.asarray(x, dtype=float), n) for x in operands], axis=1)
    begins, ramps = times.T
    late = (begins < 0.0) | (begins * rows[:, XI] > 2.0 * np.pi * (1.0 + 1e-12))
    if np.any(late | ~np.isfinite(begins)):
        raise ValueError(f"`begin` must lie within the first forcing period, but is {begins[late]}")
    checks.not_negative("ramp", ramps, every=True)
    return times


def _table_of(forcing: GroundForcing) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the pieces of all ground motions in one table, and the settings of the runs that refer to it."""
    lengths, which = np.array([len(r) for r in forcing.records]), np.asarray(forcing.which)
    # Each run has the row of its first piece.
    firsts = np.cumsum(lengths) - lengths
    # The equations contain minus the acceleration of the base.
    pieces = np.ascontiguousarray(-np.concatenate([np.asarray(r, dtype=float) for r in forcing.records]))
    return pieces, {"pieces": lengths[which], "record": firsts[which], "free": forcing.free}


def _trace_ground_run(
    row: Any, y0: Any, forcing: GroundForcing, limits: dict[str, Any], parameters: int
) -> Run:
    """Simulate one run under a ground motion, which JAX may trace."""
    (pieces,) = forcing.records
    settings = RUNS.settings("GROUND", pieces=pieces.shape[-2], record=-1.0, free=forcing.free, **limits)
    # The equations contain minus the acceleration of the base.
    operands = jnp.asarray(row), jnp.asarray(y0), -jnp.asarray(pieces), packed(settings)
    (*angles,), end, (*at, lifted, fell), out = _ground_run(*operands, parameters)
    names = ("tilt", "swing", "rod_angle")
    with_slopes = dict(zip((*names, *(f"settled_{name}" for name in names)), 2 * angles, strict=True))
    with_slopes |= {"times": jnp.stack(at), "uplift_time": lifted, "overturning_time": fell}
    with_slopes |= {"state": end[:TILT_PULL], "growing": end[TILT_PULL]}
    return run_of(stop_gradient(out))._replace(**with_slopes)


Limits = tuple[tuple[str, float | int], ...]
"""Settings of `solve_steady` as pairs of name and value."""


def solve_steady(equations: Terms, x: Any, limits: Limits, slopes: int) -> tuple[SteadyNumbers, Any]:
    """Return the steady state of a run under a harmonic, and the slopes of amplitude, swing and state.

    Args:
        equations: linear or nonlinear.
        x: parameters and initial state at tau = 0, shape (14,). If `x` is a NumPy array, the results are
            NumPy numbers, and no JAX program runs.
        limits: periods, events, tolerance and rest_rate. The linear model also needs `lyapunov_periods`,
            the number of periods over which the separation of neighbouring runs is measured. The nonlinear
            equations also need rtol.
        slopes: number of parameters, from the first on, in which to compute the slopes. The others are NaN.
    """
    settings = _steady_settings(equations, limits, slopes)
    if isinstance(x, np.ndarray):
        out, xp = np.empty(1, STEADY), np
        RUNS.entry().run(0, 1, settings, x[:WIDTH], x[WIDTH:], out)
        of = parts(out[0], STEADY)
    else:
        (out,), xp = RUNS((shape(STEADY),), settings, x[:WIDTH], x[WIDTH:]), jnp
        of = parts(out, STEADY)
    periods, elapsed = xp.asarray(of.periods, dtype=int), xp.asarray(of.elapsed, dtype=int)
    rest = periods, of.multiplier, of.symmetric == 1.0, of.lyapunov, of.state, elapsed
    return SteadyNumbers(of.amplitude, of.swing, xp.asarray(of.status, dtype=np.int32), *rest), of.by


@lru_cache(maxsize=8)
def _steady_settings(equations: Terms, limits: Limits, slopes: int) -> np.ndarray:
    """Return a row of settings for a steady state."""
    settings = {**accuracy(equations), **dict(limits)}
    return np.array(RUNS.settings("STEADY_STATE", slopes=float(slopes), **settings))


def _ground_run_from(with_slopes: bool, settings: Array, x: Array, y: Array, pieces: Array) -> Any:
    """Call the compiled code for one run, with derivatives or without."""
    entry = RUNS.entry()
    shapes = shape(RUN), shape(entry.OUTPUTS, entry.INPUTS)
    return RUNS(shapes[: 1 + with_slopes], settings, x, y, pieces)


_ground_run_with_slopes = once(partial(_ground_run_from, True))


@partial(jax.custom_jvp, nondiff_argnums=(4,))
def _ground_run(
    x: Array, y: Array, pieces: Array, settings: Array, parameters: int
) -> tuple[Array, Array, Array, Array]:
    """Return the results of one run under a ground motion.

    These are the three largest angles; the state at the end with the growing coordinate; the times of the
    angles, of the first uplift and of overturning; and all results as floats. Derivatives are those in the
    first `parameters`, or in all of them together with the initial state.
    """
    del parameters
    (out,) = _ground_run_from(False, settings, x, y, pieces)
    return _divided(out)


def _divided(out: Array) -> tuple[Array, Array, Array, Array]:
    """Divide the results into the parts that have derivatives, as `_ground_run` returns them."""
    of = parts(out, RUN)
    angles, end = (of.tilt, of.swing, of.rod_angle), (of.state[:TILT_PULL], of.growing)
    times = of.times, of.uplift_time, of.overturning_time
    return jnp.stack(angles), jnp.hstack(end), jnp.hstack(times), out


def _ground_run_jvp(parameters: int, primals: tuple, tangents: tuple) -> tuple:
    entry = RUNS.entry()
    column = entry.SETTINGS.names.index
    x, y, pieces, settings = primals
    # The directions of the derivatives are the parameters, and the components of the initial state if it is
    # differentiated.
    _, of_start, _, _ = tangents
    inputs = parameters if isinstance(of_start, SymbolicZero) else int(entry.INPUTS)
    # The largest angles often occur long before the end, so that their derivatives need only a part of the
    # legs. There are two calls, one for the angles and one for the end. XLA removes the call whose results a
    # program does not use.
    with_slopes = settings.at[column("slopes")].set(inputs)
    out, by_angles = _ground_run_with_slopes(with_slopes.at[column("angles")].set(1.0), x, y, pieces)
    _, by_end = _ground_run_with_slopes(with_slopes, x, y, pieces)
    of = parts(out, RUN)
    xs, ys, _, times = (
        jnp.zeros(t.shape, jnp.float64) if isinstance(t, SymbolicZero) else t for t in tangents
    )
    direction, point = jnp.concatenate([xs, ys]), jnp.concatenate([x, y])
    angles, end = moved(by_angles[ANGLES], direction, point), moved(by_end[END], direction, point)
    # The time of overturning never has a derivative, and some of the other times have none. `moved` lets such
    # a NaN reach only the program that needs this derivative.
    slopes = jnp.concatenate([by_angles[TIMES], jnp.full((1, direction.size), jnp.nan)])
    at = moved(slopes, direction, point)
    # With a longer free time the state moves on: angles change with their rates, and rates with the
    # accelerations.
    rates = jnp.concatenate([of.state[TILT_RATE:], jnp.zeros(1)])
    end = end + jnp.where(jnp.isfinite(rates), rates, 0.0) * times[column("free")]
    # The same holds for angles that are largest at the end of the run.
    whole = settings[column("pieces")] * x[XI] + settings[column("free")]
    last = jnp.abs(of.times - whole) <= _AT_END * whole
    tilt, swing, tilting, swinging, *_ = of.state
    growing = jnp.stack([tilting, swinging, swinging - tilting])
    sides = jnp.sign(jnp.stack([tilt, swing, swing - tilt]))
    angles = angles + jnp.where(last & jnp.isfinite(growing), sides * growing, 0.0) * times[column("free")]
    at = at + jnp.concatenate([last.astype(float), jnp.zeros(2)]) * times[column("free")]
    return _divided(out), (angles, end, at, jnp.zeros_like(out))


_ground_run.defjvp(_ground_run_jvp, symbolic_zeros=True)
