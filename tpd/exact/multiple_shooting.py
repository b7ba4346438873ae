"""Periodic orbits of any sequence of events, by Newton's method on their closed-form arcs.

A periodic motion is a cycle of arcs (slip, stick or rest, each with its signs), and every arc ends in an
event: a turn (phi' = 0), a landing (phi = 0, with its impact) or a release (the moment on the held
block reaches what holds it). With the sequence given, the unknowns are the states and the phases of the
forcing at the starts of the arcs, and their durations; the equations are the joints between the arcs and the
events. No event is solved for by itself, so that nothing is divided by the rate at which it is met, and no
error grows over more than one arc.

Held arcs lose the tilt and its rate: the state that enters one has phi' = 0 exactly (phi = 0 as well at
rest), and the projections that see to it are part of the equations and of their derivatives.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from tpd.exact.calling import LINEAR
from tpd.exact.terms import LASTS, PHASE, RELEASE, REST, SLIP, XI

_STEPS = 21
"""Most steps of Newton's method."""
_NEAR, _CONVERGED = 1e-9, 1e-6
"""Shares of its scale below which a Newton step is the last but one, and that the last step may have gone."""


class Events(NamedTuple):
    """Events of a motion in order, and the arcs that follow them."""

    times: np.ndarray
    endings: np.ndarray
    modes: np.ndarray
    """Rows of kinds, signs of phi (0 at rest), and signs of phi' (0 on a held arc)."""
    states: np.ndarray
    resting: bool
    """Whether the block rests at the end."""


class Cycle(NamedTuple):
    """Sequence of arcs, and a guess where they are."""

    modes: np.ndarray
    """Rows of kinds and signs, see `Events`, and of endings."""
    arcs: np.ndarray
    """State and phase of the forcing (rad) at the start, and duration, of every arc: shape (arcs, 6)."""


class Orbit(NamedTuple):
    """A cycle that Newton's method has arrived at."""

    links: np.ndarray
    """See `tpd.exact.cycle_kernel.LINK`."""
    arcs: np.ndarray
    """See `Cycle`."""
    by: np.ndarray
    """Derivatives of `arcs` in the nine parameters, shape (arcs, 6, 9)."""
    monodromy: np.ndarray
    """Derivative of the map over the whole cycle, cut just after the start of its first arc."""
    met: np.ndarray
    """See `tpd.exact.cycle_kernel.SURVEY`."""


def _run(task: str, rows: int, settings: dict[str, Any], *buffers: np.ndarray) -> None:
    """Have the compiled code do a task."""
    LINEAR.entry().run(0, rows, np.array([LINEAR.settings(task, **settings)]), *buffers)


def events(x: np.ndarray, y0: np.ndarray, periods: int, most: int, rest_rate: float) -> Events | str:
    """The events of the motion from `y0` at tau = 0 over so many forcing periods, at most `most` in each, or
    the name of the status of a motion that has more or is lost."""
    from tpd.exact.events import END, FIRST, SECOND
    from tpd.exact.follow import EXHAUSTED, LOST
    from tpd.exact.linear_entry import ENDED
    from tpd.exact.motion import LEG

    legs, ended = np.empty(0, LEG), np.array([(2.0 * most, 0.0)], ENDED)
    limits = {"periods": periods, "events": most, "rest_rate": rest_rate}
    while len(legs) < ended["legs"].item():
        legs = np.empty(int(ended["legs"].item()), LEG)
        _run("LEGS_OF", 1, {**limits, "pieces": len(legs)}, x[None], y0[None], legs, ended)
    (end,) = ended
    legs = legs[: int(end["legs"])]
    if not np.all(np.isfinite([*x, *y0, *legs["lasted"], *legs["y"].flat])):
        return "failed"
    if end["how"] in (LOST, EXHAUSTED):
        return "overturned" if end["how"] == LOST else "event_bound"
    which = legs["which"]
    # Turns of the bob divide arcs, and so do ends of forcing periods, at which time begins again.
    whole = np.cumsum(which == END) - (which == END)
    met = np.flatnonzero((which == FIRST) | (which == SECOND))
    kinds, tilts, ways = (legs[name][met + 1] for name in ("kind", "tilt", "way"))
    modes = np.stack([kinds, np.where(kinds == REST, 0.0, tilts), np.where(kinds == SLIP, ways, 0.0)])
    times = legs["begun"] + legs["lasted"] + 2.0 * np.pi / x[XI] * whole
    endings = np.where(legs["kind"] == SLIP, which, RELEASE)
    return Events(times[met], endings[met], modes, legs["y"][met + 1], bool(legs["kind"][-1] == REST))


def recorded(x: np.ndarray, y0: np.ndarray, periods: int, max_events: int, rest_rate: float) -> Cycle | str:
    """A cycle of so many forcing periods of the motion from `y0` at tau = 0, of at most `max_events` arcs; or
    the name of the status of a motion that has none.

    The cut lies in the middle of the longest arc, where no event can fall on the wrong side of it.
    """
    most, span = 2 * max_events + 2, periods * 2.0 * np.pi / x[XI]
    found = events(x, y0, 2 * periods, most, rest_rate)
    if isinstance(found, str):
        return found
    times = found.times
    if found.resting and not np.any(times > span):
        return "rest"
    # Two periods are recorded so that one whole period lies around any cut. An event at the cut itself would
    # belong to both sides or to none by rounding; the middle of the longest arc is as far from all events as
    # can be.
    gaps = np.where(times[:-1] <= span, np.diff(times), 0.0)
    before = int(np.argmax([*gaps, 0.0]))
    middle = times[before] + 0.5 * gaps[before] if np.any(gaps) else np.inf
    here = np.flatnonzero((times > middle) & (times <= middle + span))
    if len(times) >= most or len(here) > max_events:
        return "event_bound"
    if len(here) == 0 or np.any(found.modes[:, before] != found.modes[:, here[-1]]):
        return "no_orbit"
    following = np.roll(here, -1)
    durations = times[following] - times[here]
    durations[-1] += span
    arcs = np.column_stack([found.states[here], x[XI] * times[here], durations])
    return Cycle(np.vstack([found.modes[:, here], found.endings[following]]), arcs)


def traverse(
    x: np.ndarray, links: np.ndarray, arcs: np.ndarray, surveyed: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States after arcs and their events, phases of the forcing there, and values of the events' signals,
    shape (arcs, 6); their derivatives in the directions that are the imaginary parts of the rows of
    parameters (rows, 9) and arcs (rows, arcs, 6), shape (arcs, 6, rows); and if `surveyed` what is met along
    the arcs."""
    from tpd.exact.cycle_kernel import SURVEY
    from tpd.exact.plant import STEP

    out, met = np.empty(arcs.shape, complex), np.empty(len(links), SURVEY)
    x, arcs = (np.ascontiguousarray(np.real(z) + STEP * 1j * np.imag(z)) for z in (x, arcs))
    _run("ARCS", len(x), {"pieces": len(links), "slopes": float(surveyed)}, x, links, arcs, out, met)
    return np.real(out[0]), np.moveaxis(np.imag(out), 0, -1) / STEP, met


def polish(x: np.ndarray, cycle: Cycle, periods: int, scale: np.ndarray) -> Orbit | None:
    """The orbit near a cycle by Newton's method; None if it does not converge, or to arcs that are no motion.
    `scale` has the sizes of a state's components."""
    from tpd.exact.cycle_kernel import LINK

    # Shooting over a whole period multiplies errors by the growth of every arc and divides them by the rate
    # at which every event is met. Here states, phases and durations of all arcs are unknowns at once, so that
    # a step needs only the linear map of each arc by itself, and stays regular where an event is met at zero
    # rate.
    (modes, arcs), directions, moved, steps = cycle, 1j * np.eye(15), np.inf, 0
    links = np.vstack([modes, np.roll(modes[[0, 2]], -1, axis=1)]).T.copy().view(LINK)[:, 0]
    sizes = np.array([*scale, 1.0, 2.0 * np.pi * periods / x[XI]])
    while True:
        ends, blocks, _ = traverse(x + directions[:, 6:], links, arcs + directions[:, None, :6])
        ends[:, :LASTS] -= np.roll(arcs[:, :LASTS], -1, axis=0)
        ends[-1, PHASE] -= 2.0 * np.pi * periods
        # The step, and by the implicit function theorem the derivatives at the root: dx = -J^-1 dR.
        both = _solved(blocks[:, :, :6], np.concatenate([ends[:, :, None], blocks[:, :, 6:]], axis=2))
        if both is None:
            return None
        step, last, steps = both[:, :, 0], moved, steps + 1
        arcs, moved = arcs - step, np.max(np.abs(step) / sizes)
        # Among hops of a rattle rounding keeps the steps from getting smaller than this.
        if last < _NEAR or last <= moved < _CONVERGED or steps == _STEPS:
            break
    if not moved < _CONVERGED:
        return None
    _, _, met = traverse(x[None], links, arcs[None], surveyed=True)
    if not np.all(met["inside"]):
        return None
    leaving = np.column_stack([met[f"v{i}"] for i in range(4)])
    return Orbit(links, arcs, -both[:, :, 1:], _monodromy(blocks, leaving), met)


def _solved(blocks: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    """Solution (arcs, 6, columns) of the joints and events linearised, with the derivatives `blocks` of every
    arc by itself; None if there is none."""
    # With arcs from both ends of the cycle in turn, neighbours are at most two places apart: the matrix is a
    # band. Elimination with pivots is as exact in it as in the whole matrix.
    n, width = len(blocks), 17
    place = 6 * np.minimum(2 * np.arange(n), 2 * np.arange(n)[::-1] + 1)[:, None] + np.arange(6)
    band, ordered = np.zeros((2 * width + 1, 6 * n)), np.empty((6 * n, right.shape[2]))
    rows, columns = place[:, :, None], place[:, None, :]
    band[width + rows - columns, columns] = blocks
    onward = np.roll(place[:, :5], -1, axis=0)
    band[width + place[:, :5] - onward, onward] -= 1.0
    ordered[place] = right
    try:
        return solve_banded((width, width), band, ordered, check_finite=False)[place]
    except np.linalg.LinAlgError:
        return None


def _monodromy(blocks: np.ndarray, leaving: np.ndarray) -> np.ndarray:
    """The arcs' flows, and the saltation matrices and projections of their events, one after the other."""
    # An event met late by dt shifts the state by dt times the difference of the rates before and after it.
    # With dt = -(derivative of the event's signal)/(its rate) that is the saltation matrix of each link.
    whole = np.eye(4)
    for block, after in zip(blocks, np.roll(leaving, -1, axis=0), strict=True):
        late = -block[LASTS, :PHASE] / block[LASTS, LASTS]
        whole = (block[:PHASE, :PHASE] + np.outer(block[:PHASE, LASTS] - after, late)) @ whole
    return whole
