"""The symmetric period-one orbits as one parameter varies, joined to branches, and their bifurcations.

At a bifurcation one more function of crossing time, phase and parameter vanishes beside the two conditions of
the orbit (`tpd.exact.orbits.Vanishing`): a square system in closed form, which Newton's method
solves to round-off. A sweep supplies the initial guesses, and the orbits that it finds on both sides have to
agree with the bifurcation.

What varies is given by its name: one of nu, mu, lam, zeta, k, f, xi, e and rho, the other parameters
constant. In a scene also width, height, mass, friction, restitution, amplitude, frequency, pendulum_mass,
pendulum_length or pendulum_damping, the other quantities in SI units constant: a higher `frequency` is a
larger xi and, at the same amplitude, a larger f. rho follows nu where the subject leaves it so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.symmetric_orbits import ORBITS, Margins, Orbits, all_symmetric_orbits
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.exact.orbits import sample_path, vanishing
from tpd.exact.terms import BROKEN, CROSSED, FLAT, MERGED, STUCK, TOUCHED, TURNING, XI
from tpd.scene.parameters import Parameters, from_row
from tpd.scene.quantities import UNITS, Axis
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, names_of, status_name

_FINER = 16
"""Parts that a gap is divided into where no bifurcation was found next to it."""
_DEPTH = 5
"""Largest number of such divisions, one within the other."""
_AWAY = np.geomspace(1e-5, 0.1, 40)
"""Distances from a bifurcation, in shares of the range, at which the orbits on both sides are examined.
There are several, because two orbits that are about to merge cannot be separated too close to their fold."""
_NEAR = 0.5
"""Largest distance of such an orbit, in shares of half a period and in rad."""
_APART = 1.0
"""Distance of two orbits, as the sum of shares of h, rad, and logarithms of the amplitude, beyond
which they are never neighbours on a branch."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """The orbits over `n` values of one parameter or quantity: arrays (n, 3), NaN where there is no orbit."""

    name: str
    value: np.ndarray
    """(n,)"""
    status: np.ndarray
    """Names: rocking (attracting), unstable, neutral, near_fold, grazing or no_orbit."""
    amplitude: np.ndarray
    """Largest |phi|, rad."""
    swing: np.ndarray
    """Largest |psi|, rad."""
    phase: np.ndarray
    """Phase xi tau of the forcing at the upper turn, rad, in (-pi, pi]."""
    crossing: np.ndarray
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    multipliers: np.ndarray
    """(n, 3, 4), Floquet multipliers over one forcing period."""
    margins: Margins
    """Functions that vanish where an orbit is lost: fold, symmetry, sticking and grazing. Dimensionless."""
    overflow: np.ndarray
    """(n,), whether there were more orbits than places."""
    branch: np.ndarray
    """Number of the continuous branch that an orbit is on, from 0; -1 where there is no orbit."""

    @property
    def branches(self) -> int:
        """Number of branches."""
        return int(self.branch.max(initial=-1)) + 1

    def line(self, branch: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of one branch in the order of the values, to index any of the arrays:
        `s.value[s.line(0)[0]]` against `s.amplitude[s.line(0)]`."""
        rows, columns = np.nonzero(self.branch == branch)
        return rows, columns


def orbits_at(axis: Axis, values: np.ndarray) -> tuple[Orbits, np.ndarray]:
    """The orbits at any values, as NumPy arrays, and the names of their statuses."""
    orbits = all_symmetric_orbits(from_row(list(axis.at(values).T)))
    return orbits, names_of(orbits.status)


def along(axis: Axis, grid: np.ndarray) -> Sweep:
    """Return the orbits that `symmetric_orbits` finds over a checked grid of increasing values.

    Neighbours are joined to branches where crossing time, phase and amplitude continue and det(I - G) keeps
    its sign, so that no branch runs through a fold.
    """
    orbits, names = orbits_at(axis, grid)
    shares = orbits.crossing * axis.at(grid)[:, [XI]] / np.pi
    place = np.stack([shares, orbits.phase, np.log(orbits.amplitude)], axis=-1)
    same = ("amplitude", "swing", "phase", "crossing", "multipliers", "overflow")
    arrays: Any = {n: np.asarray(getattr(orbits, n)) for n in same}
    branch = _joined(grid, place, np.sign(orbits.margins.fold))
    about = {"name": axis.name, "value": grid, "status": names, "branch": branch}
    return Sweep(**about, **arrays, margins=orbits.margins)


def _joined(grid: np.ndarray, place: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Labels of the branches, row by row.

    Args:
        grid: values, shape (n,).
        place: crossing time (share of half a period), phase and log amplitude, shape (n, 3, 3).
        side: sign of det(I - G), shape (n, 3): two orbits that merge in a fold have different signs.
    """
    # The change per unit of the value predicts the next place, so that branches that cross are not swapped.
    labels, slope, count = np.full(side.shape, -1), np.zeros_like(place), 0
    for i in range(len(grid)):
        for new, old in _joints(i, grid, place, slope, side) if i else []:
            labels[i, new] = labels[i - 1, old]
            slope[i, new] = wrapped(place[i, new] - place[i - 1, old]) / (grid[i] - grid[i - 1])
        for new in np.nonzero(~np.isnan(place[i, :, 0]) & (labels[i] < 0))[0]:
            labels[i, new], count = count, count + 1
    return labels


def _joints(
    i: int, grid: np.ndarray, place: np.ndarray, slope: np.ndarray, side: np.ndarray
) -> list[tuple[int, int]]:
    """Pairs of an orbit in row i and its neighbour in the row before: as many as possible, and among
    these the closest to what the rows before predict."""
    ahead = place[i - 1] + slope[i - 1] * (grid[i] - grid[i - 1])
    apart = np.minimum(_distances(place[i], ahead), _distances(place[i], place[i - 1]))
    allowed = (apart < _APART) & (side[i][:, None] == side[i - 1])

    def pairs(order: tuple[int, ...]) -> list[tuple[int, int]]:
        return [(new, old) for new, old in enumerate(order) if allowed[new, old]]

    # Three orbits have six pairings: trying all is simpler than an assignment solver, and exact.
    every = (pairs(order) for order in permutations(range(ORBITS)))
    return min(every, key=lambda found: (-len(found), sum(apart[pair] for pair in found)))


def wrapped(difference: np.ndarray) -> np.ndarray:
    """A difference of two places, its phase (the second entry) in [-pi, pi)."""
    phase = np.mod(difference[..., 1] + np.pi, 2.0 * np.pi) - np.pi
    return np.concatenate([difference[..., :1], phase[..., None], difference[..., 2:]], axis=-1)


def _distances(new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Distances between the orbits of two rows, shape (3, 3); NaN where there is no orbit."""
    return np.abs(wrapped(new[:, None] - old[None, :])).sum(axis=-1)


class Kind(StrEnum):
    """How a symmetric period-one orbit is lost or changes its nature."""

    fold = "fold"
    """Two orbits merge and vanish (saddle-node): a Floquet multiplier reaches +1."""
    symmetry_breaking = "symmetry_breaking"
    """A multiplier passes +1, the orbit goes on, and two mirror images of each other branch off."""
    sticking = "sticking"
    """phi'' just after the turn reaches zero: beyond, friction holds the block there."""
    grazing = "grazing"
    """phi' touches zero between the turns: beyond, the block turns back once more. Without friction (k = 0)
    phi touches zero there: beyond, the block strikes its base once more."""
    unresolved = "unresolved"
    """An orbit is lost or changes, and none of these was found to explain it."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Bifurcation(Printed):
    """One bifurcation. Angles in rad; numbers are NaN where they are not known."""

    kind: Kind
    name: str
    """Parameter or quantity that varies."""
    value: float
    """Its value at the bifurcation; the middle of the gap if unresolved."""
    error: float
    """The last Newton step of `value`, the size of its rounding; half the gap if unresolved."""
    amplitude: float
    """Largest |phi|."""
    phase: float
    """Phase xi tau of the forcing at the upper turn, in (-pi, pi]."""
    crossing: float
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    touching: float = math.nan
    """Grazing only: dimensionless time from the upper turn to the touch."""
    below: str = ""
    """Name of the orbit's status just below `value`; at a fold rocking if one of the two is."""
    above: str = ""
    """Name of the orbit's status just above `value`."""
    slopes: dict[str, float] = field(default_factory=dict)
    """d value / d(each other parameter, or each other quantity of a scene); rho follows nu where the subject
    leaves it so."""
    reason: str = ""
    """Unresolved only: sentence that says what is missing."""

    def __str__(self) -> str:
        at = f"{self.kind.value.replace('_', ' '):18} {self.value:10.6g} {UNITS.get(self.name, '')}".rstrip()
        if self.reason:
            return f"{at}: {self.reason}"
        sides = f"{self.below} below, {self.above} above".replace("_", " ")
        return f"{at}, amplitude {self.amplitude:.5g} rad: {sides}"


def bifurcations(
    subject: Parameters | Scene,
    name: str,
    low: checks.Real,
    high: checks.Real,
    *,
    samples: checks.Whole = 200,
    pendulum: Pendulum | None = None,
) -> list[Bifurcation]:
    """Places where symmetric period-one orbits are lost or lose their symmetry as `name` varies.

    The equations phi'(0) = 0 and phi(t) = 0 are solved together with: their derivative determinant in
    (t, gamma) (fold); det(I + G), G the derivative of the mirrored half-period map (symmetry
    breaking); phi''(0+) (sticking); phi'(s) and phi''(s), s between the turns, or without friction phi(s) and
    phi'(s) (grazing).

    Two bifurcations between two samples that cancel each other are missed. A complex pair of multipliers
    that passes the unit circle (Neimark-Sacker) is not searched for.

    Args:
        subject: dimensionless parameters, or a scene; its value of `name` is not used.
        name: parameter or quantity that varies, see `tpd.answers.bifurcations`.
        low: lower end of its range.
        high: upper end.
        samples: number of values in the first sweep of the range.
        pendulum: in the scene; default none.

    Returns:
        Bifurcations in the order of their values. Each is confirmed by the orbits on both sides; where
        that fails, or where an orbit is lost without a cause found, `kind` is unresolved, and `reason` says
        why.

    Raises:
        ValueError: an unknown name, batched parameters, no interval, or fewer than 8 samples.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    axis = Axis.of(subject, name, pendulum)
    low, high = checks.interval("(low, high)", (low, high), -math.inf, math.inf)
    samples = int(checks.within("samples", samples, 8.0, 100_000.0))
    axis.check(low, high)
    search = _Search(axis, low, high, (high - low) / (samples - 1))
    found = _distinct(_explained(search, np.linspace(low, high, samples), _DEPTH))
    inside = (b for b in found if low <= b.value <= high)
    return sorted((_confirmed(search, b) for b in inside), key=lambda b: b.value)


class _Search(NamedTuple):
    axis: Axis
    low: float
    high: float
    spacing: float
    """Distance of two values in the first sweep."""

    def window(self, kind: Kind, gap: _Gap) -> tuple[float, float]:
        """Interval of values that may explain a gap: wider than the gap, because the sweep loses two orbits
        before they merge, and because it recognises grazing from samples in time."""
        if kind is Kind.fold:
            beyond = 0.1 * (self.high - self.low)
            return self.low - beyond, self.high + beyond
        ends = gap.value, gap.other
        return min(ends) - self.spacing, max(ends) + self.spacing


class _Gap(NamedTuple):
    """Two neighbouring values between which an orbit is lost, or loses or gains its symmetry."""

    value: float
    """Value where the orbit is."""
    other: float
    lost: bool
    """Whether the orbit is lost at the other value; else its det(I + G) changes sign."""
    t: float
    gamma: float

    @property
    def causes(self) -> tuple[Kind, ...]:
        """Kinds of bifurcation that would explain the gap."""
        if self.lost:
            return Kind.fold, Kind.sticking, Kind.grazing
        return (Kind.symmetry_breaking,)


def _gaps(s: Sweep) -> Iterator[_Gap]:
    """Gaps of a sweep, from every orbit to its neighbours on both sides."""
    margin = np.asarray(s.margins.symmetry)
    for i, j in zip(*np.nonzero(s.branch >= 0), strict=True):
        for to in {max(i - 1, 0), min(i + 1, len(s.value) - 1)} - {i}:
            there = np.nonzero(s.branch[to] == s.branch[i, j])[0]
            lost = len(there) == 0
            turned = not lost and margin[i, j] * margin[to, there[0]] < 0
            if lost or (turned and to > i):
                values = float(s.value[i]), float(s.value[to])
                yield _Gap(*values, lost, float(s.crossing[i, j]), float(s.phase[i, j]))


def _explained(search: _Search, grid: np.ndarray, depth: int) -> list[Bifurcation]:
    """Bifurcations that explain the gaps of a sweep; a gap without one is swept again with finer steps."""
    found = []
    for gap in _gaps(along(search.axis, grid)):
        # All kinds are tried, not only the causes of the gap: another one nearby costs little to find.
        kinds = [kind for kind in Kind if kind is not Kind.unresolved]
        points = [b for kind in kinds if (b := _located(search, gap, kind)) is not None]
        found += points
        if any(b.kind in gap.causes for b in points):
            continue
        finer = np.linspace(min(gap.value, gap.other), max(gap.value, gap.other), _FINER + 1)
        # A gap may be so narrow that its division gives equal numbers: then it cannot be resolved further.
        if depth and np.all(np.diff(finer) > 0):
            found += _explained(search, finer, depth - 1)
            continue
        change = "is lost" if gap.lost else "changes the sign of its det(I + G)"
        causes = " or ".join(kind.value.replace("_", " ") for kind in gap.causes)
        between = f"between {gap.value:.15g} and {gap.other:.15g}"
        middle, half = 0.5 * (gap.value + gap.other), 0.5 * abs(gap.value - gap.other)
        where = {"name": search.axis.name, "value": middle, "error": half, "phase": gap.gamma}
        reason = f"an orbit {change} {between}, but no {causes} was found"
        unknown = {"kind": Kind.unresolved, "amplitude": math.nan, "crossing": gap.t, "reason": reason}
        found.append(Bifurcation(**where, **unknown))
    return found


def _located(search: _Search, gap: _Gap, kind: Kind) -> Bifurcation | None:
    """The bifurcation of a kind next to a gap, by Newton's method from the orbit there."""
    (x,) = search.axis.at(np.array([gap.value]))
    guesses = [np.array([gap.t, gap.gamma])]
    if kind is Kind.grazing:
        # The two peaks of phi' between the turns that are closest to zero.
        rates = sample_path(guesses[0], x).rates
        peaks = np.nonzero((rates[1:-1] >= rates[:-2]) & (rates[1:-1] >= rates[2:]))[0] + 1
        times = (np.arange(len(rates)) + 1.0) / (len(rates) + 1) * np.pi / x[XI]
        guesses = [np.append(guesses[0], times[i]) for i in sorted(peaks, key=lambda i: -rates[i])[:2]]
    for guess in guesses:
        point = _newton(search, kind, guess, gap)
        if point is not None:
            return _on_orbit(search, kind, point)
    return None


class _Point(NamedTuple):
    """A solution of the augmented system."""

    u: np.ndarray
    """(t, gamma), and s for grazing."""
    value: float
    x: np.ndarray
    """The parameters there, in the order of NAMES."""
    moved: float
    """The last step of `value`."""
    slopes: np.ndarray
    """Its derivative with respect to each of the axis' others."""


def _newton(search: _Search, kind: Kind, guess: np.ndarray, gap: _Gap) -> _Point | None:
    """Solve for u and the value by Newton's method with limited steps; None if it does not end nearby."""
    u, m, value, last, rows = guess, len(guess), gap.value, math.inf, _ROWS[kind]
    low, high = search.window(kind, gap)
    for _ in range(40):
        (x,) = search.axis.at(np.array([value]))
        # The residual, and its derivatives in u, and in the varied number and the axis' others.
        at = vanishing(np.append(u, [1.0] * (3 - m)), x)
        residual, by_axis = at.values[rows], at.by_x[rows] @ search.axis.jacobian(value)
        system = np.column_stack([at.by_u[rows, :m], by_axis[:, 0]])
        if not np.all(np.isfinite(system)) or np.linalg.matrix_rank(system) <= m:
            return None
        # The columns beyond the first are the derivatives of the solution, by the implicit function theorem.
        solved = np.linalg.solve(system, -np.column_stack([residual, by_axis[:, 1:]]))
        step, span = solved[:, 0], np.pi / x[XI]
        share = np.abs(step) / np.array([*(span, 1.0, span)[:m], high - low])
        # A long step would leave for another orbit: at most a tenth of half a period, and 0.1 rad of phase.
        step = step * min(1.0, 0.1 / max(share[:m].max(), 0.1), 1.0 / max(share[m], 1.0))
        u, value = u + step[:m], float(np.clip(value + step[m], low, high))
        before, last = last, share.max()
        # Converged to round-off: the steps are below 1e-9 and no longer shrink.
        if last < 1e-15 or (before < 1e-9 and last >= before):
            near = max(abs(u[0] - gap.t) / span, abs(u[1] - gap.gamma)) <= _NEAR
            (x,) = search.axis.at(np.array([value]))
            point = _Point(u, value, x, abs(float(step[m])), solved[m, 1:])
            return point if last <= 1e-9 and near and low < value < high else None
    return None


_ROWS = {
    Kind.fold: [TURNING, CROSSED, MERGED],
    Kind.symmetry_breaking: [TURNING, CROSSED, BROKEN],
    Kind.sticking: [TURNING, CROSSED, STUCK],
    Kind.grazing: [TURNING, CROSSED, TOUCHED, FLAT],
}
"""Entries of `vanishing` that are zero at a bifurcation of each kind."""


def _on_orbit(search: _Search, kind: Kind, point: _Point) -> Bifurcation | None:
    """The bifurcation at a point, or None where its path has not the signs of an orbit elsewhere."""
    u, x, axis = point.u, point.x, search.axis
    way = sample_path(u[:2], x)
    touching = float(u[2]) if kind is Kind.grazing else math.nan
    times = [t for t in (u[0], touching) if not math.isnan(t)]
    # The quantity that vanishes at this point is zero to rounding only, so that its sign is not checked.
    highest = float(way.rates.max()) - 1e-9 * x[XI] * way.height * (kind is Kind.grazing)
    falling = max(highest, -1.0 if kind is Kind.sticking else way.leaving, way.arriving) < 0
    if not (way.height > 0 and falling and min(times) > 0 and max(times) < np.pi / x[XI]):
        return None
    return Bifurcation(
        kind=kind,
        name=axis.name,
        value=point.value,
        error=point.moved,
        amplitude=way.height,
        phase=math.remainder(float(u[1]), 2.0 * math.pi),
        crossing=float(u[0]),
        touching=touching,
        slopes={n: float(slope) for n, slope in zip(axis.others, point.slopes, strict=True)},
    )


def _distinct(found: list[Bifurcation]) -> list[Bifurcation]:
    """The bifurcations, each once. The search finds a fold twice, from both branches that end there."""
    distinct: list[Bifurcation] = []
    for b in found:
        close = 1e-9 * abs(b.value) + 1e-12
        twins = (a for a in distinct if a.kind is b.kind and abs(a.value - b.value) <= close)
        if not any(abs(a.crossing - b.crossing) <= 1e-4 * b.crossing for a in twins):
            distinct.append(b)
    return distinct


def _confirmed(search: _Search, b: Bifurcation) -> Bifurcation:
    """The bifurcation with the statuses on both sides; unresolved where these contradict its kind.

    At some distance one side must have two orbits more at a fold, one more at sticking and grazing; where
    symmetry breaks their number stays and det(I + G) changes its sign.
    """
    if b.kind is Kind.unresolved:
        return b
    # Two orbits vanish at a fold, one at sticking and grazing, none where the symmetry breaks.
    away = _AWAY * (search.high - search.low)
    lost = {Kind.fold: 2, Kind.symmetry_breaking: 0}.get(b.kind, 1)
    sides = (_neighbours(search, b, b.value + side * away, max(lost, 1)) for side in (-1.0, 1.0))
    for below, above in zip(*sides, strict=True):
        more = below.near - above.near
        if abs(more) == lost and (lost or below.margin * above.margin < 0):
            none = status_name(Status.no_orbit)
            names = none if more < 0 else below.status, none if more > 0 else above.status
            return replace(b, below=names[0], above=names[1])
    reason = f"a {b.kind.value.replace('_', ' ')} was located, but the orbits on both sides do not show it"
    return replace(b, kind=Kind.unresolved, reason=reason)


class _Neighbour(NamedTuple):
    near: int
    """Number of orbits near a point."""
    status: str
    """Status of the closest orbit; or rocking, if several are asked for and one of them is."""
    margin: float
    """det(I + G) of the closest."""


def _neighbours(search: _Search, b: Bifurcation, values: np.ndarray, several: int) -> list[_Neighbour]:
    """The orbits near a bifurcation at other values."""
    values = np.clip(values, search.low, search.high)
    orbits, names = orbits_at(search.axis, values)
    symmetry = np.asarray(orbits.margins.symmetry)
    at = search.axis.at(np.append(values, b.value))[:, [XI]] / np.pi
    places = np.stack([orbits.crossing * at[:-1], orbits.phase], axis=-1)
    apart = np.abs(wrapped(places - np.array([b.crossing * at[-1, 0], b.phase]))).max(axis=-1)
    apart = np.where(apart < _NEAR, apart, np.inf)
    out = []
    for i, order in enumerate(np.argsort(apart, axis=1)):
        close, rocking = [str(names[i, j]) for j in order[:several]], status_name(Status.rocking)
        status = rocking if rocking in close else close[0]
        out.append(_Neighbour(int(np.isfinite(apart[i]).sum()), status, float(symmetry[i, order[0]])))
    return out
