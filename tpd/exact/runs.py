"""The one door to runs of the linear equations (25) and of the nonlinear equations (4): `follow`.

Runs whose numbers are known are computed at once, a batch on all cores. One run may also be traced by JAX.
The compiled code runs on the host's processor, as `tpd.exact.calling` says, and has derivatives of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.lax import stop_gradient
from jaxtyping import Array, Int

from tpd.core import checks
from tpd.exact.calling import LINEAR, NONLINEAR, Compiled, numbers_in, parts, shape
from tpd.exact.derivatives import moved, once, refused_in
from tpd.exact.rows import packed
from tpd.exact.terms import ENDS, TILT_PULL, TILT_RATE, XI
from tpd.scene.parameters import NAMES
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status, codes_of
from tpd.theory.equations import Terms

ENGINES = {Terms.linear: LINEAR, Terms.nonlinear: NONLINEAR}
"""Entrances to the compiled code by the equations."""
TOLERANCE = 1e-6
"""Repetition error that counts as settled, by default; see `tpd.exact.repetition.scales_of`."""
REST_RATES = {Terms.linear: 2e-7, Terms.nonlinear: 1e-4}
"""Rates phi', over nu, below which an impact on a block that can be held ends in rest, by default."""
PERIODS = {Terms.linear: 500, Terms.nonlinear: 400}
"""Bounds on the forcing periods of a run, by default."""
EVENTS = 2000
"""Bound on the events of a forcing period, by default."""
GROUND_EVENTS = {Terms.linear: 200_000, Terms.nonlinear: 100_000}
"""Bounds on the events of a run under a ground motion beyond one for each piece, by default."""
_AT_END = 1e-12
"""Relative distance of two times that are the same but for rounding."""
ANGLES, END, TIMES = slice(0, 3), slice(3, 8), slice(8, 12)
"""Derivatives of a run: of the three angles; of the state at the end and the growing coordinate; of the
times of the angles and of the first uplift."""


class HarmonicForcing(NamedTuple):
    """A harmonic: runs are followed until they repeat, rest or are lost. Numbers for all runs, or (n,)."""

    periods: int | None = None
    """Largest number of forcing periods of a run, by default one of `PERIODS`."""
    begin: Any = 0.0
    """Dimensionless times at which the excitation and the run begin, within the first forcing period."""
    ramp: Any = 0.0
    """Forcing periods over which the excitation grows linearly to its full size, counted from tau = 0 also
    for runs that begin later. The default is sudden."""


class GroundForcing(NamedTuple):
    """Ground motions: runs are followed through all pieces of one, and freely afterwards."""

    records: Sequence[Any]
    """Pieces of each ground motion, `GroundMotion.pieces`, which are not copied for each run."""
    free: Any
    """Time of free motion after the ground motion (tau), a number or (n,)."""
    which: Any = 0
    """Index of the ground motion of each run."""


class Settled(eqx.Module):
    """Where a motion has settled. Not differentiated: a start value for its periodic orbit."""

    y: State
    """State at tau = 0 modulo the forcing period."""
    memory: Any
    """Anything else that a model needs to go on from there; None of compiled code."""
    periods: Int[Array, ""]
    """Forcing periods in one period of the motion."""
    amplitude: Number
    """Largest |phi| of the last periods; the answer where there is no periodic orbit."""
    swing: Number
    """Largest |psi| of the last periods."""
    status: Status
    elapsed: Int[Array, ""]
    """Forcing periods simulated."""
    peak: Number
    """Largest |phi| from the start on."""
    peak_swing: Number
    """Largest |psi| from the start on."""


class Followed(NamedTuple):
    """A run under a ground motion, or a batch of them: numbers of shape (...).

    Angles are in rad and times in tau. NumPy's arrays of a batch, JAX's of one run.
    """

    tilt: Any
    """Largest |phi|; infinite after an overturning."""
    swing: Any
    """Largest |psi|."""
    relative: Any
    """Largest |psi - phi|: the angle between rod and block."""
    times: Any
    """Times of the three, shape (..., 3)."""
    state: Any
    """(phi, psi, phi', psi') at the end, shape (..., 4)."""
    growing: Any
    """Growing coordinate of the last arc at its start: 0 between overturning and falling back. NaN of the
    nonlinear equations."""
    status: Any
    """Index among `tpd.exact.terms.SHAKEN`."""
    impacts: Any
    lifted: Any
    """Time of the first uplift; infinite without one."""
    fell: Any
    """Time from which the block is beyond return; infinite if it never is."""
    transversality: Any
    """Least rate at which the motion met an event, over the usual rate. NaN of the nonlinear equations."""


def follow(
    equations: Terms,
    rows: Any,
    forcing: HarmonicForcing | GroundForcing,
    *,
    y0: Any = None,
    rest_rate: Any = None,
    events: int | None = None,
    tolerance: Any = TOLERANCE,
    rtol: Any = 1e-8,
    brief: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Any:
    """Follow a run, or a batch of runs.

    Args:
        equations: linear or nonlinear. Runs of the nonlinear equations have no derivatives (NaN), every
            landing is an impact, and a run that does not repeat is `not_settled`.
        rows: parameters as `tpd.exact.rows` has them, of one run (9,), traced or not, or of a batch (n, 9).
        forcing: a harmonic or ground motions.
        y0: starts (4,), or (n, 4), which make one row those of a batch; at rest by default.
        rest_rate: an impact slower than this (phi' in units of nu) that the block can be held after is rest;
            by default one of `REST_RATES`.
        events: bound on the events of a forcing period, by default `EVENTS`; of a run under a ground motion
            beyond one for each piece, by default one of `GROUND_EVENTS`.
        tolerance: repetition error that counts as settled.
        rtol: relative tolerance of a step of the nonlinear equations.
        brief: whether free motion after a ground motion may end as soon as it cannot tilt the block further:
            then only tilt, uplift and overturning hold. For the linear equations.
        workers: threads of a batch; all cores by default.
        progress: called with (runs done, of how many) now and then, for a batch.

    Returns:
        `Settled` under a harmonic, with leaves (n,) for a batch in its order, or `Followed` under ground
        motions. Derivatives of one run of the linear equations under a ground motion in rows, free time and
        start are exact for the angles, their times, the time of the first uplift, the state and the growing
        coordinate, or NaN where there is none; that of the time of the overturning and those in the pieces
        are NaN. A run under a harmonic has no derivatives.

    Raises:
        ValueError: an empty batch, arrays of different lengths, a number out of range, or workers below one.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    engine = ENGINES[equations]
    limits = {"rest_rate": REST_RATES[equations] if rest_rate is None else rest_rate}
    if equations is Terms.nonlinear:
        limits["rtol"] = checks.tolerance("rtol", rtol)
    ground = isinstance(forcing, GroundForcing)
    if ground:
        limits["events"] = GROUND_EVENTS[equations] if events is None else events
    else:
        limits |= {"events": EVENTS if events is None else events, "tolerance": tolerance}
        limits["periods"] = PERIODS[equations] if forcing.periods is None else forcing.periods
    many = np.ndim(rows) > 1 or np.ndim(y0) > 1
    # Of one run whose numbers are known, JAX would compile a program.
    if many or all(map(checks.is_concrete, jax.tree.leaves((rows, y0, forcing, limits)))):
        x, y = (rows, y0) if many else (np.asarray(rows)[None], None if y0 is None else np.asarray(y0)[None])
        batch = _Batch.of(x, y, workers, progress)
        if ground:
            runs = _run_batch(engine, batch, forcing, limits | {"brief": brief})
            return runs if many else Followed(*(x[0] for x in runs))
        settled = _settle_batch(engine, batch, forcing, limits)
        return settled if many else jax.tree.map(lambda x: x[0, ...], settled)
    start = jnp.zeros(4) if y0 is None else y0
    if ground:
        return _run_one(engine, rows, start, forcing, limits)
    record, settings = engine.entry().SETTLED, packed(engine.settings("SETTLE", **limits))
    times = packed((forcing.begin, forcing.ramp))
    (out,) = engine((shape(numbers_in(record)),), settings, stop_gradient(rows), stop_gradient(start), times)
    return _settled_of(out, record)


class _Batch(NamedTuple):
    """Starts (n, 4) and parameters (n, 9) of runs, and how these are shared among threads."""

    starts: np.ndarray
    rows: np.ndarray
    workers: int | None
    progress: Callable[[int, int], None] | None

    @staticmethod
    def of(rows: Any, y0: Any, workers: int | None, progress: Any) -> _Batch:
        """The runs of rows and starts, one of which may be single."""
        starts = np.zeros((len(rows), 4)) if y0 is None else np.array(y0, dtype=float, order="C")
        n, width = len(starts), len(NAMES)
        if n == 0 or starts.shape != (n, 4) or np.shape(rows) not in ((width,), (n, width)):
            shapes = f"{np.shape(rows)} and {starts.shape}"
            raise ValueError(f"`rows` must have shape (n, {width}) and `y0` (n, 4), but have {shapes}")
        wide = np.ascontiguousarray(np.broadcast_to(rows, (n, width)), dtype=float)
        return _Batch(starts, wide, workers, progress)

    def fill(self, engine: Compiled, settings: np.ndarray, table: np.ndarray, results: np.ndarray) -> None:
        """Compute the records `found` of all runs; `table` holds what the runs have besides."""
        buffers = settings, self.rows, self.starts, table, results
        engine.in_threads(len(self.rows), self.workers, self.progress, *buffers)


def _settle_batch(
    engine: Compiled, batch: _Batch, forcing: HarmonicForcing, limits: dict[str, Any]
) -> Settled:
    n, operands = len(batch.rows), (forcing.begin, forcing.ramp)
    if shapes := {np.shape(x) for x in operands} - {(), (n,)}:
        raise ValueError(f"`begin` and `ramp` must have shape ({n},), but have {shapes}")
    times = np.stack([np.broadcast_to(np.asarray(x, dtype=float), n) for x in operands], axis=1)
    begins, ramps = times.T
    late = (begins < 0.0) | (begins * batch.rows[:, XI] > 2.0 * np.pi * (1.0 + 1e-12))
    if np.any(late | ~np.isfinite(begins)):
        raise ValueError(f"`begin` must lie within the first forcing period, but is {begins[late]}")
    checks.not_negative("ramp", ramps, every=True)
    # Loaded here, and not with the package: it loads Numba.
    entry = engine.entry()
    settings = np.full(n, np.array(tuple(engine.settings("SETTLE", **limits)), entry.SETTINGS))
    results = np.empty(n, entry.SETTLED)
    batch.fill(engine, settings, times, results)
    return _settled_of(results.view(float).reshape(n, -1), entry.SETTLED)


def _settled_of(numbers: Any, record: np.dtype) -> Settled:
    """Where runs have settled, from the records of compiled code as floats."""
    of, index = parts(numbers, record), codes_of(ENDS)
    code, periods, elapsed = (x.astype(int) for x in (of.status, of.periods, of.elapsed))
    status = index[code] if isinstance(code, np.ndarray) else jnp.asarray(index)[code]
    # From its leaves, because fields are annotated with the shapes of a single motion.
    sizes, peaks = (of.amplitude, of.swing), (of.peak, of.peak_swing)
    leaves = [of.y, periods, *sizes, status, elapsed, *peaks]
    return jax.tree.unflatten(_structure(), leaves)


@lru_cache(maxsize=1)
def _structure() -> Any:
    """Structure of the pytree of a `Settled`."""
    none, count = jnp.zeros(()), jnp.zeros((), int)
    about = count, none, none, Status.failed, count, none, none
    return jax.tree.structure(Settled(jnp.zeros(4), None, *about))


def _run_batch(engine: Compiled, batch: _Batch, forcing: GroundForcing, limits: dict[str, Any]) -> Followed:
    entry, n = engine.entry(), len(batch.rows)
    lengths, which = np.array([len(r) for r in forcing.records]), np.asarray(forcing.which)
    # All records lie one after another; a run knows the row of its first piece.
    firsts = np.cumsum(lengths) - lengths
    pieces = np.ascontiguousarray(-np.concatenate([np.asarray(r, dtype=float) for r in forcing.records]))
    settings: Any = np.zeros(n, entry.SETTINGS)
    places = {"task": entry.GROUND, "pieces": lengths[which], "record": firsts[which], "free": forcing.free}
    for name, value in {**places, **limits}.items():
        settings[name] = value
    results = np.zeros(n, entry.FOLLOWED)
    batch.fill(engine, settings, pieces, results)
    return _followed_of(results.view(float).reshape(n, -1))


def _run_one(engine: Compiled, row: Any, y0: Any, forcing: GroundForcing, limits: dict[str, Any]) -> Followed:
    (pieces,) = forcing.records
    settings = engine.settings("GROUND", pieces=pieces.shape[-2], record=-1.0, free=forcing.free, **limits)
    # The equations have minus the acceleration of the base.
    operands = jnp.asarray(row), jnp.asarray(y0), -jnp.asarray(pieces), packed(settings)
    if engine is LINEAR:
        angles, end, times, out = _ground_run(*operands)
        *at, lifted, fell = times
        tilt, swing, relative = angles
        sizes = {"tilt": tilt, "swing": swing, "relative": relative, "times": jnp.stack(at)}
        state = {"state": end[:TILT_PULL], "growing": end[TILT_PULL], "lifted": lifted, "fell": fell}
        return _followed_of(stop_gradient(out))._replace(**sizes, **state)
    x, y, c, s = map(stop_gradient, operands)
    (out,) = engine((shape(numbers_in(engine.entry().FOLLOWED)),), s, x, y, c)
    results = _followed_of(out)
    # Angles, times and state depend on all of this in a way that nobody has computed.
    names = ("tilt", "swing", "relative", "times", "state", "lifted", "fell")
    return results._replace(**{name: refused_in(operands, getattr(results, name)) for name in names})


def _followed_of(out: Any) -> Followed:
    """Runs from all results of compiled code."""
    of = parts(out, LINEAR.entry().FOLLOWED)
    angles, state = (of.sizes[..., k] for k in range(3)), of.state[..., :TILT_PULL]
    counted = of.status, of.impacts, of.uplift_time, of.overturn_time, of.transversality
    return Followed._make((*angles, of.times, state, of.growing, *counted))


Limits = tuple[tuple[str, float | int], ...]
"""Settings by their names, for `solve`."""


def solve(equations: Terms, x: Any, y0: Any, limits: Limits) -> Any:
    """Return the steady state of a run under a harmonic: a record `tpd.exact.steady.STEADY` as floats.

    Args:
        equations: of the nonlinear ones multiplier, Lyapunov exponent and derivatives are NaN.
        x, y0: the row of parameters, and the state at tau = 0. Of NumPy's arrays the answer is one as well,
            and no program of JAX is asked.
        limits: periods, events, tolerance and rest_rate; of the linear equations also lyapunov, the periods
            over which neighbours are followed; of the nonlinear ones also rtol.
    """
    engine, row, n = _steady_call(equations, limits)
    if not (isinstance(x, np.ndarray) and isinstance(y0, np.ndarray)):
        (out,) = engine((shape(n),), row, x, y0)
        return out
    out = np.empty(n)
    engine.entry().run(0, 1, row, np.ascontiguousarray(x, float), np.ascontiguousarray(y0, float), out)
    return out


@lru_cache(maxsize=8)
def _steady_call(equations: Terms, limits: Limits) -> tuple[Compiled, np.ndarray, int]:
    """The entrance, a row of settings for `solve`, and how many numbers it gives."""
    engine = ENGINES[equations]
    row = np.array(engine.settings("STEADY_STATE", **dict(limits)))
    return engine, row, numbers_in(engine.entry().STEADY)


def _ground_run_from(inputs: float, settings: Array, x: Array, y: Array, pieces: Array) -> Any:
    entry = LINEAR.entry()
    shapes = shape(numbers_in(entry.FOLLOWED)), shape(*((entry.SHAKEN, entry.INPUTS) if inputs else (1, 1)))
    return LINEAR(shapes, settings, x, y, pieces)


_ground_run_with_slopes = once(partial(_ground_run_from, 1.0))


@jax.custom_jvp
def _ground_run(x: Array, y: Array, pieces: Array, settings: Array) -> tuple[Array, Array, Array, Array]:
    """The three angles, the state at the end with the growing coordinate, the times of the angles, of the
    first uplift and of the overturning, and all results."""
    out, _ = _ground_run_from(0.0, settings, x, y, pieces)
    return _divided(out)


def _divided(out: Array) -> tuple[Array, Array, Array, Array]:
    of = parts(out, LINEAR.entry().FOLLOWED)
    end, times = (of.state[:TILT_PULL], of.growing), (of.times, of.uplift_time, of.overturn_time)
    return of.sizes, jnp.hstack(end), jnp.hstack(times), out


def _ground_run_jvp(primals: tuple, tangents: tuple) -> tuple:
    entry = LINEAR.entry()
    column = entry.FIELDS.index
    x, y, pieces, settings = primals
    # All parameters, and four components of the start where that moves.
    _, of_start, of_pieces, _ = tangents
    inputs = len(NAMES) if isinstance(of_start, SymbolicZero) else int(entry.INPUTS)
    # The largest angles are often met long before the end. A program that asks for them alone leaves the
    # second call out, on which nothing depends.
    asked = settings.at[column("slopes")].set(inputs)
    out, by_angles = _ground_run_with_slopes(asked.at[column("angles")].set(1.0), x, y, pieces)
    _, by_end = _ground_run_with_slopes(asked, x, y, pieces)
    of = parts(out, entry.FOLLOWED)
    xs, ys, samples, times = (
        jnp.zeros(t.shape, jnp.float64) if isinstance(t, SymbolicZero) else t for t in tangents
    )
    direction = jnp.concatenate([xs, ys])
    angles, end = by_angles[ANGLES] @ direction, by_end[END] @ direction
    # Some times have no derivative, that of the overturning never: NaN meets only what asks for it.
    slopes = jnp.concatenate([by_angles[TIMES], jnp.full((1, direction.size), jnp.nan)])
    at = moved(slopes, direction, jnp.concatenate([x, y]))
    # The state goes on for longer where the free time grows: angles move with their rates, and rates with
    # the accelerations.
    rates = jnp.concatenate([of.state[TILT_RATE:], jnp.zeros(1)])
    end = end + jnp.where(jnp.isfinite(rates), rates, 0.0) * times[column("free")]
    # So do angles that are largest where the motion ends.
    whole = settings[column("pieces")] * x[XI] + settings[column("free")]
    last = jnp.abs(of.times - whole) <= _AT_END * whole
    tilt, swing, tilting, swinging, *_ = of.state
    growing = jnp.stack([tilting, swinging, swinging - tilting])
    sides = jnp.sign(jnp.stack([tilt, swing, swing - tilt]))
    angles = angles + jnp.where(last & jnp.isfinite(growing), sides * growing, 0.0) * times[column("free")]
    at = at + jnp.concatenate([last, jnp.zeros(2)]) * times[column("free")]
    if not isinstance(of_pieces, SymbolicZero):
        # Derivatives in the samples of a record are not computed: not a number, and not zero.
        unknown = jnp.nan * jnp.sum(samples)
        angles, end, at = angles + unknown, end + unknown, at + unknown
    return _divided(out), (angles, end, at, jnp.zeros_like(out))


_ground_run.defjvp(_ground_run_jvp, symbolic_zeros=True)
