"""Any periodic orbit of the exact model: period n, asymmetric, sticking, resting, with impacts.

A simulation says in which order the events of one period come; the orbit with that order is then the
solution of closed-form equations (`tpd.exact.multiple_shooting`), whether it attracts or repels. So an
orbit can be followed where no simulation stays near it, and its derivatives follow from the implicit function
theorem. All of it is computed on the host; programs of JAX call back.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from tpd.core import checks
from tpd.exact.calling import numbers_in, parts, shape
from tpd.exact.derivatives import with_slopes
from tpd.exact.multiple_shooting import Cycle, Orbit, polish, recorded, traverse
from tpd.exact.rows import row_of
from tpd.exact.terms import GRAZING, LASTS, NEAR_FOLD, PHASE, SLIP, SWING, TILT, XI, is_neutral
from tpd.scene.parameters import NAMES, Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import single
from tpd.scene.status import Status

MAX_EVENTS = 64
"""Most events in one period of an orbit, by default."""
REST_RATE = 1e-6
"""Slowest impact that is followed, phi' in units of nu: a slower one ends a rattle."""
_MIRRORED = 1e-8
"""Largest deviation from its mirror image, in shares of the scales, of a symmetric orbit."""
_ARC = np.dtype([("numbers", np.float64, (6,)), ("link", np.float64, (4,))])
"""An arc as `Cycle.arcs` has it, with its kind, both signs and its ending."""
Start = Cycle | str
"""Guess that Newton's method starts from, or the name of the status of a motion without an orbit."""
_Numbers = namedtuple("_Numbers", NAMES)
"""Parameters as plain numbers."""


class Sequence(eqx.Module):
    """The arcs of one period in order; leading axis `max_events`, of which `count` are in use."""

    kinds: Int[Array, "*batch arcs"]
    """0 slip, 1 stick, 2 rest."""
    tilt_signs: Float[Array, "*batch arcs"]
    """Sign of phi; 0 at rest."""
    rate_signs: Float[Array, "*batch arcs"]
    """Sign of phi'; 0 on a held arc."""
    endings: Int[Array, "*batch arcs"]
    """The event at the end: 0 turn, 1 landing, 2 release."""
    durations: Float[Array, "*batch arcs"]
    """Dimensionless time; 0 where not in use."""
    phases: Float[Array, "*batch arcs"]
    """xi tau at the start of the arc, rad; 0 at tau = 0 of the recording."""
    states: Float[Array, "*batch arcs 4"]
    """(phi, psi, phi', psi') at the start of the arc, after the event there."""
    count: Int[Array, "*batch"]


class CycleMargins(eqx.Module):
    """Distances from the loss of an orbit, as functions that vanish where it happens. Their derivatives
    are NaN."""

    fold: Float[Array, "*batch"]
    """det(I - M), M the derivative of the map over one period of the orbit: two orbits merge, or a
    symmetric one gives way to a pair."""
    grazing: Float[Array, "*batch"]
    """The least dent of a signal that keeps an arc going (the rate of a slipping block, the slack of a
    held one) over its largest value, infinite without one: at zero there is one more event."""
    sticking: Float[Array, "*batch"]
    """||R| - k|/(|R| + k) at the nearest of the turns, R the moment there less the weight's: at zero
    the block begins or ceases to stick at that turn. Infinite without a turn."""


class PeriodicOrbit(eqx.Module):
    """A periodic orbit; angles in rad.

    `amplitude`, `stroke`, `state` and the numbers of `sequence` are differentiable in every parameter,
    also on unstable orbits; those of `multipliers` and `margins` are NaN. Where the status is not rocking,
    sticking or unstable the derivatives of the first three are NaN, and so are they themselves where it is
    no_orbit, event_bound, failed, overturned or rest (but amplitude 0 for rest): of an overturning motion
    there is no orbit, whereas `steady_state` calls its amplitude infinite. An orbit has at least one event:
    a block that is held at a tilt for ever is no_orbit.
    """

    status: Status
    """rocking or sticking (attracting), unstable, near_fold, grazing, no_orbit, event_bound, failed
    (a number that is not finite), or, of the recorded motion, overturned or rest."""
    amplitude: Float[Array, "*batch"]
    """Largest |phi|."""
    stroke: Float[Array, "*batch"]
    """Largest |psi|."""
    state: Float[Array, "*batch 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the orbit's period."""
    periods: Int[Array, "*batch"]
    """Forcing periods in one period of the orbit."""
    symmetric: Bool[Array, "*batch"]
    """Whether the orbit is its own mirror image half a period later."""
    sequence: Sequence
    multipliers: Complex[Array, "*batch 4"]
    """Floquet multipliers over one period of the orbit; attracting if all are below 1 in size."""
    margins: CycleMargins


def periodic_orbit(
    p: Parameters,
    y0: checks.Vector,
    *,
    periods: checks.Whole = 1,
    max_events: checks.Whole = MAX_EVENTS,
    rest_rate: checks.Real = REST_RATE,
) -> PeriodicOrbit:
    """The periodic orbit near a state, which need not attract.

    The motion from `y0` is followed over twice `periods`, and the events of one of them become the
    sequence of the orbit. `steady_state(p).state` and its `periods` are a good start.

    Args:
        p: dimensionless parameters; gradients with respect to them are exact.
        y0: (phi, psi, phi', psi') near the orbit at tau = 0, in rad and rad per unit tau.
        periods: forcing periods in one period of the orbit.
        max_events: most events in one period.
        rest_rate: an impact slower than this (phi' in units of nu) that the block can be held after
            counts as rest, which ends a rattle; the error is of the order of its square.

    Works under `jit`, `vmap`, `grad` and `jacfwd`.

    Raises:
        ValueError: `y0` has not four components, or a bound is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_parameters(p)
    periods, max_events = (
        checks.count("periods", periods, most=1000),
        checks.count("max_events", max_events, most=100_000),
    )
    rest_rate, y = checks.tolerance("rest_rate", rest_rate), jnp.asarray(checks.state(y0))

    def start(x: np.ndarray, periods: int, y0: np.ndarray, rate: np.ndarray) -> Start:
        return recorded(x, y0, periods, max_events, float(rate))

    return _answered(p, start, max_events, periods, y, rest_rate)


def continue_orbit(p: Parameters, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with the same sequence of events as `orbit`, at other parameters near by.

    Nothing is simulated: unstable orbits, and stable ones near a fold or a grazing, are followed just
    as well. Where the sequence is no longer a motion the status is no_orbit.

    Works under `jit`, `vmap`, `grad` and `jacfwd`; `orbit` is a guess and is not differentiated.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    s = orbit.sequence
    modes = s.kinds, s.tilt_signs, s.rate_signs, s.endings
    numbers = s.states, s.durations, s.phases, s.count
    return _answered(p, _carried_over, s.kinds.size, orbit.periods, *modes, *numbers)


def _carried_over(x: np.ndarray, periods: int, *sequence: np.ndarray) -> Start:
    """The arcs of another orbit: at another frequency they keep their phases rather than their times."""
    *modes, states, durations, phases, many = sequence
    count = int(many)
    if count == 0 or not np.all(np.isfinite([*x, *states.flat])):
        return "no_orbit"
    stretched = 2.0 * np.pi * periods / (x[XI] * np.sum(durations)) * durations
    return Cycle(np.stack(modes)[:, :count], np.column_stack([states, phases, stretched])[:count])


def _answered(
    p: Parameters, start: Callable[..., Start], size: int, periods: ArrayLike, *operands: ArrayLike
) -> PeriodicOrbit:
    """The orbit with the sequence of at most `size` arcs that `start` makes of the operands."""
    names = ("amplitude", "stroke", "fold", "grazing", "sticking", "status", "symmetric", "count")
    arrays = ("state", np.float64, (4,)), ("multipliers", np.complex128, (4,)), ("arcs", _ARC, (size,))
    record = np.dtype([*((name, np.float64) for name in names), *arrays])
    x, solve, many = row_of(as_arrays(single(p))), partial(_solved, start, record), numbers_in(record)
    given = [v if checks.is_concrete(v) else stop_gradient(v) for v in (x, periods, *operands)]
    # What is known, outside of programs and under `grad` there, needs no program of JAX.
    if all(map(checks.is_concrete, given)):
        values, slopes = solve(*given)
    else:
        shapes = shape(many), shape(many, len(NAMES))
        values, slopes = jax.pure_callback(solve, shapes, *given, vmap_method="sequential")
    values = values if isinstance(x, np.ndarray) else with_slopes(x, jnp.asarray(values), jnp.asarray(slopes))
    of = parts(jnp.asarray(values), record)
    arcs, (real, imaginary) = parts(of.arcs, _ARC), jnp.moveaxis(of.multipliers, -1, 0)
    kinds, tilts, ways, endings = arcs.link.T
    durations, phases, states = arcs.numbers[:, LASTS], arcs.numbers[:, PHASE], arcs.numbers[:, :PHASE]
    modes = kinds.astype(int), tilts, ways, endings.astype(int)
    return PeriodicOrbit(
        status=jax.tree.unflatten(jax.tree.structure(Status.rocking), [of.status.astype(jnp.int32)]),
        amplitude=of.amplitude,
        stroke=of.stroke,
        state=of.state,
        periods=jnp.asarray(periods),
        symmetric=of.symmetric != 0.0,
        sequence=Sequence(*modes, durations, phases, states, of.count.astype(int)),
        multipliers=real + 1j * imaginary,
        margins=CycleMargins(of.fold, of.grazing, of.sticking),
    )


# Newton's method may run away.
@np.errstate(all="ignore")
def _solved(
    start: Callable[..., Start], record: np.dtype, *given: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of an orbit as a record of floats, on the host, and their derivatives in the nine parameters,
    shape (floats, 9)."""
    x, many, *operands = map(np.asarray, given)
    p, periods, size = _Numbers(*x), int(many), numbers_in(record)
    values, by = np.full((1, size), np.nan), np.full((len(x), size), np.nan)
    # The same numbers by name, as records of shapes (1,) and (9,).
    o, slopes = values.view(record)[:, 0], by.view(record)[:, 0]
    o["arcs"], o["symmetric"], o["count"] = 0.0, 0.0, 0.0
    slopes["arcs"]["link"], slopes["status"], slopes["symmetric"], slopes["count"] = 0.0, 0.0, 0.0, 0.0
    span, rate = periods * 2.0 * np.pi / p.xi, max(p.xi, 1.0)
    scale = np.array([p.nu, p.nu + p.f, p.nu * rate, (p.nu + p.f) * rate])
    cycle = start(x, periods, *operands)
    status = cycle if isinstance(cycle, str) else "no_orbit"
    orbit = None if isinstance(cycle, str) else polish(x, cycle, periods, scale)
    if status == "rest":
        o["amplitude"], slopes["amplitude"] = 0.0, 0.0
    if orbit is not None:
        count, kinds = len(orbit.links), orbit.links["kind"]
        matrix = orbit.monodromy if np.all(np.isfinite(orbit.monodromy)) else np.zeros((4, 4))
        if p.mu == 0.0:
            # A bob without mass cannot be felt and is left out: two multipliers are zero then.
            matrix[1::2], matrix[:, 1::2] = 0.0, 0.0
        multipliers = np.linalg.eigvals(matrix)
        grazing, sticking = np.min(orbit.met["dip"]), np.min(orbit.met["sticking"])
        # Each line overrules those above it.
        largest, status = np.max(np.abs(multipliers)), "sticking" if np.any(kinds != SLIP) else "rocking"
        status = status if largest < 1.0 else "unstable"
        status = "neutral" if is_neutral(p.k, p.e, p.mu, p.zeta, largest) else status
        status = "grazing" if grazing < GRAZING else status
        status = "near_fold" if np.min(np.abs(1.0 - multipliers)) < 2.0 * NEAR_FOLD else status
        half = count // 2
        if periods % 2 == 1 and count % 2 == 0:
            # The second half of the arcs may be the mirror image of the first.
            apart = np.abs(orbit.arcs[:half, :PHASE] + orbit.arcs[half:, :PHASE]) / scale
            longer = np.abs(orbit.arcs[:half, LASTS] - orbit.arcs[half:, LASTS]) / span
            o["symmetric"] = bool(max(np.max(apart), np.max(longer)) < _MIRRORED)
        sizes, by_sizes = _looked_up(x, orbit, span)
        o["fold"], o["grazing"], o["sticking"] = np.linalg.det(np.eye(4) - matrix), grazing, sticking
        o["count"], o["multipliers"] = count, multipliers
        o["amplitude"], o["stroke"], o["state"] = sizes[TILT], sizes[SWING], sizes[2:]
        (arcs,) = o["arcs"]
        arcs["numbers"][:count] = orbit.arcs
        arcs["link"][:count] = orbit.links.view(float).reshape(count, -1)[:, :4]
        if status not in ("near_fold", "grazing"):
            slopes["amplitude"], slopes["stroke"] = by_sizes[TILT], by_sizes[SWING]
            slopes["state"], slopes["arcs"]["numbers"] = by_sizes[2:].T, 0.0
            slopes["arcs"]["numbers"][:, :count] = np.moveaxis(orbit.by, -1, 0)
    o["status"] = jax.tree.leaves(getattr(Status, status))[0]
    return values[0], by.T


def _looked_up(x: np.ndarray, orbit: Orbit, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude, largest |psi| and state at tau = 0 modulo the period, and their derivatives in the nine
    parameters."""
    arcs, by, xi = orbit.arcs, orbit.by, x[XI]
    begun = arcs[:, PHASE] / xi
    whole = np.ceil(begun / span) * span
    # A tilt is monotone on its arcs, hence largest where one begins.
    i, j, k = np.argmin(whole - begun), np.argmax(orbit.met["reach"]), np.argmax(np.abs(arcs[:, TILT]))
    # Two arcs are cut short: where tau is 0, and at the largest |psi|, which is met at a share of the
    # duration whose own derivative does not count, as 0 and 1 are events and in between the bob turns.
    share, short, moved = orbit.met["at"][j] / arcs[j, LASTS], arcs[[i, j]], by[[i, j]]
    short[:, LASTS] = whole[i] - begun[i], share * arcs[j, LASTS]
    moved[:, LASTS] = -by[i, PHASE] / xi, share * by[j, LASTS]
    moved[0, LASTS, XI] -= (whole[i] - begun[i]) / xi
    links = orbit.links[[i, j]]
    links["ending"] = -1.0
    ends, slopes, _ = traverse(x + 1j * np.eye(len(x)), links, short + 1j * np.moveaxis(moved, -1, 0))
    (now, turned), (by_now, by_turned) = ends, slopes
    angles, by_angles = np.array([arcs[k, TILT], turned[SWING]]), np.array([by[k, TILT], by_turned[SWING]])
    sizes = np.append(np.abs(angles), now[:PHASE])
    return sizes, np.vstack([np.sign(angles)[:, None] * by_angles, by_now[:PHASE]])
