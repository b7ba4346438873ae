"""Motions of the linear equations under pulses and records: one under JAX's transformations, or batches.

The compiled code runs on the host's processor, under `jit`, `vmap` and derivatives as `tpd.models.calling`
says, with derivatives of its own. Batches on the host share their records and all cores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from tpd.exact.derivatives import moved, once
from tpd.exact.rows import ground_row_of
from tpd.exact.terms import TILT_PULL, TILT_RATE, XI
from tpd.models.calling import Compiled, numbers_in, parts, shape
from tpd.models.compiled_linear import EXACT, changed, settings_of
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State

_AT_END = 1e-12
"""Relative distance of two times that are the same but for rounding."""
ANGLES, END, TIMES = slice(0, 3), slice(3, 8), slice(8, 12)
"""Derivatives of a motion: of the three angles; of the state at the end and the growing coordinate; of the
times of the angles and of the first uplift."""
REST_RATE = 2e-7
"""Rate phi', over nu, below which an impact on a block that can be held ends in rest."""


class Followed(NamedTuple):
    """A motion of the linear equations under a ground motion, or a batch of them: numbers of shape (...).

    Angles are in rad and times in tau. NumPy's arrays from `follow_all`, JAX's from `follow`.
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
    """Growing coordinate of the last arc at its start: 0 between overturning and falling back."""
    status: Any
    """Index among `tpd.exact.terms.SHAKEN`."""
    impacts: Any
    lifted: Any
    """Time of the first uplift; infinite without one."""
    fell: Any
    """Time from which the block is beyond return; infinite if it never is."""
    transversality: Any
    """Least rate at which the motion met an event, over the usual rate."""


def _followed_from(inputs: float, settings: Array, x: Array, y: Array, pieces: Array) -> Any:
    entry = EXACT.entry()
    shapes = shape(numbers_in(entry.FOLLOWED)), shape(*((entry.SHAKEN, entry.INPUTS) if inputs else (1, 1)))
    return EXACT(shapes, settings, x, y, pieces)


_followed_with_slopes = once(partial(_followed_from, 1.0))


@jax.custom_jvp
def _followed(x: Array, y: Array, pieces: Array, settings: Array) -> tuple[Array, Array, Array, Array]:
    """The three angles, the state at the end with the growing coordinate, the times of the angles, of the
    first uplift and of the overturning, and all results."""
    out, _ = _followed_from(0.0, settings, x, y, pieces)
    return _parts(out)


def _parts(out: Array) -> tuple[Array, Array, Array, Array]:
    of = parts(out, EXACT.entry().FOLLOWED)
    end, times = (of.state[:TILT_PULL], of.growing), (of.times, of.lifted, of.fell)
    return of.sizes, jnp.hstack(end), jnp.hstack(times), out


def _followed_jvp(primals: tuple, tangents: tuple) -> tuple:
    column = EXACT.entry().FIELDS.index
    x, y, pieces, settings = primals
    # Nine parameters, and four components of the start where that moves.
    _, of_start, of_pieces, _ = tangents
    inputs = 9.0 if isinstance(of_start, SymbolicZero) else 13.0
    # The largest angles are often met long before the end. A program that asks for them alone leaves the
    # second call out, on which nothing depends.
    asked = changed(settings, "slopes", inputs)
    out, by_angles = _followed_with_slopes(changed(asked, "angles", 1.0), x, y, pieces)
    _, by_end = _followed_with_slopes(asked, x, y, pieces)
    of = parts(out, EXACT.entry().FOLLOWED)
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
    return _parts(out), (angles, end, at, jnp.zeros_like(out))


_followed.defjvp(_followed_jvp, symbolic_zeros=True)


def follow(p: Parameters, pieces: Array, free: Number, y0: State, max_events: int) -> Followed:
    """Follow a motion from `y0` through `pieces`, shape (n, 4), and freely for `free` (tau).

    `p` are parameters of `Scene.ground_parameters`. Derivatives in p, free and y0 of the angles, their times,
    the time of the first uplift, the state and the growing coordinate are exact, or NaN where there is none;
    that of the time of the overturning and those in the pieces are NaN.
    """
    limits = {"free": free, "rest_rate": REST_RATE, "events": max_events}
    angles, end, times, out = _followed(*operands(EXACT, p, pieces, y0, **limits))
    *at, lifted, fell = times
    tilt, swing, relative = angles
    sizes = {"tilt": tilt, "swing": swing, "relative": relative, "times": jnp.stack(at)}
    state = {"state": end[:TILT_PULL], "growing": end[TILT_PULL], "lifted": lifted, "fell": fell}
    return known(jax.lax.stop_gradient(out))._replace(**sizes, **state)


def operands(of: Compiled, p: Parameters, pieces: Any, y0: State, **limits: Any) -> tuple[Array, ...]:
    """Parameters, start, pieces and settings of a motion as the compiled code takes them."""
    # It takes the duration of a piece, and eta is minus the acceleration of the base.
    x = jnp.asarray(ground_row_of(p))
    settings = settings_of("SHAKE", of, pieces=pieces.shape[-2], record=-1.0, **limits)
    return x, jnp.asarray(y0), -jnp.asarray(pieces), settings


def known(out: Any) -> Followed:
    """Motions from all results of compiled code."""
    of = parts(out, EXACT.entry().FOLLOWED)
    sizes, end = [of.sizes[..., k] for k in range(3)], of.state[..., :TILT_PULL]
    counted = of.status, of.impacts, of.lifted, of.fell, of.crossing
    return Followed._make((*sizes, of.times, end, of.growing, *counted))


def follow_all(
    parameters: Float[np.ndarray, "n 9"],
    records: Sequence[np.ndarray],
    which: np.ndarray,
    free: np.ndarray,
    *,
    y0: np.ndarray | None = None,
    max_events: int = 200_000,
    slopes: bool = False,
    brief: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Followed, np.ndarray | None]:
    """Follow n motions on all cores.

    Args:
        parameters: a row of each, with the duration of a piece in the place of the frequency, see
            `tpd.exact.rows.row_of`.
        records: the pieces of each ground motion, `GroundMotion.pieces`; they are not copied for each motion.
        which: index of the ground motion of each.
        free: time of free motion after the ground motion, tau.
        y0: starts, shape (n, 4); at rest by default.
        max_events: events of a motion beyond one for each piece.
        slopes: whether to compute derivatives.
        brief: whether the free motion may end as soon as it cannot tilt the block further: then only tilt,
            uplift and overturning hold.
        workers: threads; all cores by default.
        progress: called with the motions done and in all.

    Returns:
        The motions, and their derivatives of shape (n, 12, 13) if asked for: of the three angles, the state
        at the end, the growing coordinate, the times of the angles and that of the first uplift, in the nine
        parameters and the four components of the start.
    """
    limits = {"free": free, "rest_rate": REST_RATE, "events": max_events, "brief": brief}
    return follow_rows(EXACT, (parameters, y0, records, which), slopes, workers, progress, **limits)


def follow_rows(
    compiled: Compiled,
    motions: tuple[np.ndarray, np.ndarray | None, Sequence[np.ndarray], np.ndarray],
    slopes: bool,
    workers: int | None,
    progress: Callable[[int, int], None] | None,
    **limits: Any,
) -> tuple[Followed, np.ndarray | None]:
    """Follow motions (parameters, starts, records and the indices of theirs) as `follow_all` does; `limits`
    are further settings of the compiled code."""
    entry, (parameters, y0, records, which) = compiled.entry(), motions
    n, lengths = len(parameters), np.array([len(r) for r in records])
    # All records lie one after another; a motion knows the row of its first piece.
    firsts = np.cumsum(lengths) - lengths
    pieces = np.ascontiguousarray(-np.concatenate([np.asarray(r, dtype=float) for r in records]))
    settings: Any = np.zeros(n, entry.SETTINGS)
    places = {"task": entry.SHAKE, "pieces": lengths[which], "record": firsts[which]}
    for name, value in {**places, "slopes": 13.0 if slopes else 0.0, **limits}.items():
        settings[name] = value
    x = np.ascontiguousarray(parameters, dtype=float)
    starts = np.zeros((n, 4)) if y0 is None else np.ascontiguousarray(y0, dtype=float)
    out = np.zeros((n, numbers_in(entry.FOLLOWED)))
    by = np.zeros((n, entry.SHAKEN, entry.INPUTS) if slopes else 1)
    compiled.in_threads(n, workers, progress, settings, x, starts, pieces, out, by)
    return known(out), by if slopes else None
