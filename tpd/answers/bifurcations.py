"""Branches of symmetric period-one orbits as one parameter varies, and their bifurcations.

At a bifurcation one more function of crossing time, phase and parameter vanishes, in addition to the two
conditions of the orbit (`tpd.compiled.orbits.Vanishing`). This is a square system in closed form, which
Newton's method solves to rounding. A sweep of the parameter gives the initial guesses, and the orbits on both
sides of a bifurcation must agree with its kind.

The varying parameter is given by its name: one of nu, mu, lam, zeta, k, f, xi, e and rho, with the other
parameters constant. For a scene it may also be width, height, mass, friction, restitution, amplitude,
frequency, pendulum_mass, pendulum_length or pendulum_damping, with the other quantities in SI units constant.
A higher `frequency` then is a larger xi and, for the same amplitude, a larger f. If rho of the subject is not
set, it varies with nu.
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
from tpd.compiled.columns import BROKEN, CROSSED, FLAT, MERGED, STUCK, TOUCHED, TURNING, XI
from tpd.compiled.orbits import sample_path, vanishing
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.scene.parameters import Parameters, from_row
from tpd.scene.quantities import UNITS, Axis
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, names_of, status_name

_PARTS = 16
"""Number of parts into which a gap without a bifurcation is divided."""
_DEPTH = 5
"""Largest number of such divisions, one inside the other."""
_DISTANCES = np.geomspace(1e-5, 0.1, 40)
"""Distances from a bifurcation, as shares of the range, at which the orbits on both sides are examined.
There are several distances, because two orbits that are about to merge cannot be separated close to a
fold."""
_MOST_DISTANCE = 0.5
"""Largest distance of such an orbit from the bifurcation, in shares of half a period and in rad."""
_NEIGHBOUR_DISTANCE = 1.0
"""Distance of two orbits beyond which they cannot be neighbours on a branch. The distance is the sum of the
differences in crossing time (share of half a period), phase (rad) and logarithm of the amplitude."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Orbits at `n` values of one parameter or quantity.

    Arrays have the shape (n, 3), unless another shape is stated. They are NaN where there is no orbit.
    """

    name: str
    """Name of the parameter or quantity."""
    value: np.ndarray
    """Values, shape (n,)."""
    status: np.ndarray
    """Names of statuses: rocking (the orbit attracts), unstable, neutral, near_fold, grazing or no_orbit."""
    amplitude: np.ndarray
    """Largest |phi|, rad."""
    swing: np.ndarray
    """Largest |psi|, rad."""
    phase: np.ndarray
    """Phase xi tau of the forcing at the upper turn, rad, in (-pi, pi]."""
    crossing: np.ndarray
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    multipliers: np.ndarray
    """Floquet multipliers over one forcing period, shape (n, 3, 4)."""
    margins: Margins
    """Functions that vanish where an orbit is lost, see `Margins`. Dimensionless."""
    overflow: np.ndarray
    """Whether there may be more orbits than the three of the arrays, shape (n,)."""
    branch: np.ndarray
    """Number of the continuous branch to which an orbit belongs, from 0; -1 without an orbit."""

    @property
    def branches(self) -> int:
        """Number of branches."""
        return int(self.branch.max(initial=-1)) + 1

    def line(self, branch: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of one branch, in the order of the values, as indices of the arrays.

        For instance, plot `s.amplitude[s.line(0)]` over `s.value[s.line(0)[0]]`.
        """
        rows, columns = np.nonzero(self.branch == branch)
        return rows, columns


def orbits_at(axis: Axis, values: np.ndarray) -> tuple[Orbits, np.ndarray]:
    """Return the orbits at given values, as NumPy arrays, and the names of their statuses."""
    orbits = all_symmetric_orbits(from_row(list(axis.at(values).T)))
    return orbits, names_of(orbits.status)


def along(axis: Axis, grid: np.ndarray) -> Sweep:
    """Return the orbits of `symmetric_orbits` over a checked grid of increasing values, joined to branches.

    Two neighbouring orbits belong to one branch if crossing time, phase and amplitude are continuous and
    det(I - G) has the same sign. A branch therefore never continues through a fold.
    """
    orbits, names = orbits_at(axis, grid)
    # Half a period is h = pi/xi, so the first coordinate is the crossing time as a share of it.
    shares = orbits.crossing * axis.at(grid)[:, [XI]] / np.pi
    place = np.stack([shares, orbits.phase, np.log(orbits.amplitude)], axis=-1)
    arrays_of_orbits = ("amplitude", "swing", "phase", "crossing", "multipliers", "overflow")
    arrays: Any = {n: np.asarray(getattr(orbits, n)) for n in arrays_of_orbits}
    branch = _joined(grid, place, np.sign(orbits.margins.fold))
    labels = {"name": axis.name, "value": grid, "status": names, "branch": branch}
    return Sweep(**labels, **arrays, margins=orbits.margins)


def _joined(grid: np.ndarray, place: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return the labels of the branches.

    Args:
        grid: values, shape (n,).
        place: crossing time (share of half a period), phase and logarithm of the amplitude, shape (n, 3, 3).
        side: sign of det(I - G), shape (n, 3). Two orbits that merge in a fold have different signs.
    """
    # The place in the next row is extrapolated, so that two branches that cross are not exchanged.
    labels, slope, count = np.full(side.shape, -1), np.zeros_like(place), 0
    for i in range(len(grid)):
        # Orbits with a neighbour in the previous row continue its branch.
        for new, old in _joints(i, grid, place, slope, side) if i else []:
            labels[i, new] = labels[i - 1, old]
            slope[i, new] = wrapped(place[i, new] - place[i - 1, old]) / (grid[i] - grid[i - 1])
        # All other orbits begin a new branch.
        for new in np.nonzero(~np.isnan(place[i, :, 0]) & (labels[i] < 0))[0]:
            labels[i, new], count = count, count + 1
    return labels


def _joints(
    i: int, grid: np.ndarray, place: np.ndarray, slope: np.ndarray, side: np.ndarray
) -> list[tuple[int, int]]:
    """Return pairs of an orbit in row i and its neighbour in row i - 1.

    The pairs are as many as possible. Among equally many, those are selected that are closest to the
    extrapolation from the previous rows.
    """
    ahead = place[i - 1] + slope[i - 1] * (grid[i] - grid[i - 1])
    # The prediction may be wrong next to the beginning of a branch, so the smaller distance counts.
    apart = np.minimum(_distances(place[i], ahead), _distances(place[i], place[i - 1]))
    allowed = (apart < _NEIGHBOUR_DISTANCE) & (side[i][:, None] == side[i - 1])

    def pairs(order: tuple[int, ...]) -> list[tuple[int, int]]:
        return [(new, old) for new, old in enumerate(order) if allowed[new, old]]

    # Three orbits have six pairings: trying all is simpler than an assignment solver, and exact.
    every = (pairs(order) for order in permutations(range(ORBITS)))
    return min(every, key=lambda matches: (-len(matches), sum(apart[pair] for pair in matches)))


def wrapped(difference: np.ndarray) -> np.ndarray:
    """Return a difference of two places with its phase (the second entry) in [-pi, pi)."""
    # A phase of almost pi and one of almost -pi are close to each other.
    phase = np.mod(difference[..., 1] + np.pi, 2.0 * np.pi) - np.pi
    return np.concatenate([difference[..., :1], phase[..., None], difference[..., 2:]], axis=-1)


def _distances(new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Return the distances between the orbits of two rows, shape (3, 3); NaN without an orbit."""
    return np.abs(wrapped(new[:, None] - old[None, :])).sum(axis=-1)


class Kind(StrEnum):
    """Ways in which a symmetric period-one orbit is lost or changes its nature."""

    fold = "fold"
    """Two orbits merge and vanish (saddle-node): a Floquet multiplier reaches +1."""
    symmetry_breaking = "symmetry_breaking"
    """A multiplier passes +1. The orbit continues, and two orbits branch off that are mirror images of each
    other."""
    sticking = "sticking"
    """phi'' just after the turn reaches zero. Beyond this value friction holds the block at the turn."""
    grazing = "grazing"
    """phi' touches zero between the turns. Beyond this value the block turns back once more. Without friction
    (k = 0) phi touches zero there, and beyond this value the block has one more impact."""
    unresolved = "unresolved"
    """An orbit is lost or changes, and none of the other kinds explains it."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Bifurcation(Printed):
    """Bifurcation of symmetric period-one orbits. Angles are in rad; unknown numbers are NaN."""

    kind: Kind
    """Kind of the bifurcation."""
    name: str
    """Name of the varying parameter or quantity."""
    value: float
    """Value at the bifurcation; the middle of the gap if unresolved."""
    error: float
    """Last Newton step of `value`, which is of the size of its rounding; half the gap if unresolved."""
    amplitude: float
    """Largest |phi|, rad."""
    phase: float
    """Phase xi tau of the forcing at the upper turn, rad, in (-pi, pi]."""
    crossing: float
    """Dimensionless time from the upper turn to the crossing of phi = 0."""
    below: str = ""
    """Name of the status of the orbit just below `value`. At a fold it is rocking if one of the two orbits
    is."""
    above: str = ""
    """Name of the status of the orbit just above `value`."""
    slopes: dict[str, float] = field(default_factory=dict)
    """Derivatives of `value` with respect to each other parameter, or to each other quantity of a scene. If
    rho of the subject is not set, it varies with nu."""
    reason: str = ""
    """Sentence that says what is missing, if unresolved."""

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
    """Find the values of a parameter at which symmetric period-one orbits are lost or lose their symmetry.

    The equations phi'(0) = 0 and phi(t) = 0 are solved together with one or two more equations: for a fold,
    the determinant of their derivatives with respect to (t, gamma) is zero; for a loss of symmetry,
    det(I + G) = 0, where G is the derivative of the mirrored half-period map; for sticking, phi''(0+) = 0;
    for grazing, phi'(s) = phi''(s) = 0 at a time s between the turns, or without friction phi(s) = phi'(s) =
    0.

    Two bifurcations between two samples that cancel each other are not found. Bifurcations at which a complex
    pair of multipliers passes the unit circle (Neimark-Sacker) are not searched for.

    Args:
        subject: dimensionless parameters, or a scene. Its own value of `name` is not used.
        name: name of the varying parameter or quantity, see the text of this module.
        low: lower end of the range.
        high: upper end of the range.
        samples: number of values in the first sweep of the range.
        pendulum: pendulum of the scene; None without a pendulum.

    Returns:
        Bifurcations in the order of their values. The orbits on both sides confirm each of them. If they do
        not, or if an orbit is lost for an unknown reason, `kind` is unresolved and `reason` explains it.

    Raises:
        ValueError: an unknown name, batched parameters, an empty interval, or fewer than 8 samples.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> from tpd.answers.bifurcations import bifurcations
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.1, k=0.05, f=0.1, xi=2.0)
        >>> [(b.kind.value, round(b.value, 3)) for b in bifurcations(p, "xi", 1.0, 1.5, samples=20)]
        [('symmetry_breaking', 1.044), ('sticking', 1.237)]
    """
    checks.require_x64()
    axis = Axis.of(subject, name, pendulum)
    low, high = checks.interval("(low, high)", (low, high), -math.inf, math.inf)
    samples = int(checks.within("samples", samples, 8.0, 100_000.0))
    axis.check(low, high)
    search = _Search(axis, low, high, (high - low) / (samples - 1))
    candidates = _distinct(_explained(search, np.linspace(low, high, samples), _DEPTH))
    inside = (b for b in candidates if low <= b.value <= high)
    # A fold may be located outside the range, see `_Search.window`. Such bifurcations are not reported.
    return sorted((_confirmed(search, b) for b in inside), key=lambda b: b.value)


class _Search(NamedTuple):
    """Settings of a search for bifurcations."""

    axis: Axis
    """Parameter or quantity that varies."""
    low: float
    """Lower end of the range."""
    high: float
    """Upper end of the range."""
    spacing: float
    """Distance of two values in the first sweep."""

    def window(self, kind: Kind, gap: _Gap) -> tuple[float, float]:
        """Return the interval in which a bifurcation may explain a gap.

        The interval is wider than the gap, because a sweep loses two orbits before they merge, and because it
        recognises grazing only from samples in time.
        """
        if kind is Kind.fold:
            beyond = 0.1 * (self.high - self.low)
            return self.low - beyond, self.high + beyond
        ends = gap.value, gap.other
        return min(ends) - self.spacing, max(ends) + self.spacing


class _Gap(NamedTuple):
    """Two neighbouring values between which an orbit is lost, or loses or gains its symmetry."""

    value: float
    """Value at which the orbit exists."""
    other: float
    """Neighbouring value."""
    disappears: bool
    """Whether the orbit does not exist at the other value. Otherwise its det(I + G) changes sign."""
    t: float
    """Crossing time of the orbit."""
    gamma: float
    """Phase of the orbit."""

    @property
    def causes(self) -> tuple[Kind, ...]:
        """Kinds of bifurcations that would explain the gap."""
        if self.disappears:
            return Kind.fold, Kind.sticking, Kind.grazing
        return (Kind.symmetry_breaking,)


def _gaps(s: Sweep) -> Iterator[_Gap]:
    """Yield the gaps of a sweep, from every orbit to its neighbours on both sides."""
    margin = np.asarray(s.margins.symmetry)
    for i, j in zip(*np.nonzero(s.branch >= 0), strict=True):
        # The rows next to row i, of which there is only one at the ends of the sweep.
        for to in {max(i - 1, 0), min(i + 1, len(s.value) - 1)} - {i}:
            neighbours = np.nonzero(s.branch[to] == s.branch[i, j])[0]
            disappears = len(neighbours) == 0
            changes_sign = not disappears and margin[i, j] * margin[to, neighbours[0]] < 0
            # A change of sign is seen from both sides, and is listed only once.
            if disappears or (changes_sign and to > i):
                values = float(s.value[i]), float(s.value[to])
                yield _Gap(*values, disappears, float(s.crossing[i, j]), float(s.phase[i, j]))


def _explained(search: _Search, grid: np.ndarray, depth: int) -> list[Bifurcation]:
    """Return bifurcations that explain the gaps of a sweep.

    A gap without a bifurcation is swept again with smaller steps, up to `depth` times.
    """
    results = []
    for gap in _gaps(along(search.axis, grid)):
        # All kinds are searched for, not only the causes of the gap: another bifurcation nearby costs little.
        kinds = [kind for kind in Kind if kind is not Kind.unresolved]
        points = [b for kind in kinds if (b := _located(search, gap, kind)) is not None]
        results += points
        if any(b.kind in gap.causes for b in points):
            continue
        # Without an explanation the gap is swept again with smaller steps.
        finer = np.linspace(min(gap.value, gap.other), max(gap.value, gap.other), _PARTS + 1)
        # If the gap is so narrow that its division gives equal numbers, it cannot be resolved further.
        if depth and np.all(np.diff(finer) > 0):
            results += _explained(search, finer, depth - 1)
            continue
        change = "is lost" if gap.disappears else "changes the sign of its det(I + G)"
        causes = " or ".join(kind.value.replace("_", " ") for kind in gap.causes)
        between = f"between {gap.value:.15g} and {gap.other:.15g}"
        # The recursion has ended without an explanation. The gap is reported as unresolved.
        middle, half = 0.5 * (gap.value + gap.other), 0.5 * abs(gap.value - gap.other)
        where = {"name": search.axis.name, "value": middle, "error": half, "phase": gap.gamma}
        reason = f"an orbit {change} {between}, but no {causes} was found"
        unknown = {"kind": Kind.unresolved, "amplitude": math.nan, "crossing": gap.t, "reason": reason}
        results.append(Bifurcation(**where, **unknown))
    return results


def _located(search: _Search, gap: _Gap, kind: Kind) -> Bifurcation | None:
    """Return the bifurcation of a kind near a gap, by Newton's method from the orbit there; None if none."""
    # Crossing time and phase of the orbit at the gap are close to those at the bifurcation.
    (x,) = search.axis.at(np.array([gap.value]))
    guesses = [np.array([gap.t, gap.gamma])]
    if kind is Kind.grazing:
        # Initial guesses for the time of contact: the two local maxima of phi' that are closest to zero.
        rates = sample_path(guesses[0], x).rates
        peaks = np.nonzero((rates[1:-1] >= rates[:-2]) & (rates[1:-1] >= rates[2:]))[0] + 1
        times = (np.arange(len(rates)) + 1.0) / (len(rates) + 1) * np.pi / x[XI]
        guesses = [np.append(guesses[0], times[i]) for i in sorted(peaks, key=lambda i: -rates[i])[:2]]
    for guess in guesses:
        point = _newton(search, kind, guess, gap)
        if point is not None:
            return _on_orbit(search, kind, *point)
    return None


def _newton(
    search: _Search, kind: Kind, guess: np.ndarray, gap: _Gap
) -> tuple[np.ndarray, float, float, np.ndarray] | None:
    """Solve for u and the value by Newton's method; None if it does not converge nearby.

    Returns:
        Crossing time and phase (t, gamma), with the time of contact s for grazing; the value; its last Newton
        step; and its derivatives with respect to each of `axis.others`.
    """
    u, m, value, last, rows = guess, len(guess), gap.value, math.inf, _ROWS[kind]
    low, high = search.window(kind, gap)
    for _ in range(40):
        (x,) = search.axis.at(np.array([value]))
        # Residual, and its derivatives with respect to u, the varying parameter, and the other parameters.
        at = vanishing(np.append(u, [1.0] * (3 - m)), x)
        residual, by_axis = at.values[rows], at.by_x[rows] @ search.axis.jacobian(value)
        system = np.column_stack([at.by_u[rows, :m], by_axis[:, :1]])
        # The system is singular where two bifurcations coincide, and NaN where the orbit does not exist.
        if not np.all(np.isfinite(system)) or np.linalg.matrix_rank(system) <= m:
            return None
        # The first column is the Newton step. The others are the derivatives of the solution with respect to
        # the other parameters, by the implicit function theorem.
        solved = np.linalg.solve(system, -np.column_stack([residual, by_axis[:, 1:]]))
        step, span = solved[:, 0], np.pi / x[XI]
        # Steps relative to half a period, to 1 rad, and to the range of values.
        share = np.abs(step) / np.array([*(span, 1.0, span)[:m], high - low])
        # A long step would lead to another orbit. The limits are a tenth of half a period and 0.1 rad.
        step = step * min(1.0, 0.1 / max(share[:m].max(), 0.1), 1.0 / max(share[m], 1.0))
        u, value = u + step[:m], float(np.clip(value + step[m], low, high))
        before, last = last, share.max()
        # Converged to rounding: the steps are below 1e-9 and no longer decrease.
        if last < 1e-15 or (before < 1e-9 and last >= before):
            near = max(abs(u[0] - gap.t) / span, abs(u[1] - gap.gamma)) <= _MOST_DISTANCE
            point = u, value, abs(float(step[m])), solved[m, 1:]
            return point if last <= 1e-9 and near and low < value < high else None
    return None


_ROWS = {
    Kind.fold: [TURNING, CROSSED, MERGED],
    Kind.symmetry_breaking: [TURNING, CROSSED, BROKEN],
    Kind.sticking: [TURNING, CROSSED, STUCK],
    Kind.grazing: [TURNING, CROSSED, TOUCHED, FLAT],
}
"""Entries of `vanishing` that are zero at a bifurcation of each kind."""


def _on_orbit(
    search: _Search, kind: Kind, u: np.ndarray, value: float, error: float, slopes: np.ndarray
) -> Bifurcation | None:
    """Return the bifurcation at a point, see `_newton`; None if the signs along its path are not those of an
    orbit."""
    axis = search.axis
    (x,) = axis.at(np.array([value]))
    # Crossing and contact must lie within the half period.
    path, times = sample_path(u[:2], x), [u[0], *u[2:]]
    # The quantity that vanishes at this point is zero except for rounding, so its sign is not checked.
    highest = float(path.rates.max()) - 1e-9 * x[XI] * path.height * (kind is Kind.grazing)
    falling = max(highest, -1.0 if kind is Kind.sticking else path.leaving, path.arriving) < 0
    if not (path.height > 0 and falling and min(times) > 0 and max(times) < np.pi / x[XI]):
        return None
    return Bifurcation(
        kind=kind,
        name=axis.name,
        value=value,
        error=error,
        amplitude=float(path.height),
        phase=math.remainder(float(u[1]), 2.0 * math.pi),
        crossing=float(u[0]),
        slopes={n: float(slope) for n, slope in zip(axis.others, slopes, strict=True)},
    )


def _distinct(candidates: list[Bifurcation]) -> list[Bifurcation]:
    """Return each bifurcation once. The search finds a fold twice, from both branches that end there."""
    distinct: list[Bifurcation] = []
    for b in candidates:
        # Two bifurcations are the same if kind, value and crossing time agree.
        close = 1e-9 * abs(b.value) + 1e-12
        twins = (a for a in distinct if a.kind is b.kind and abs(a.value - b.value) <= close)
        if not any(abs(a.crossing - b.crossing) <= 1e-4 * b.crossing for a in twins):
            distinct.append(b)
    return distinct


def _confirmed(search: _Search, b: Bifurcation) -> Bifurcation:
    """Return the bifurcation with the statuses on both sides; unresolved if these contradict its kind.

    At some distance one side must have two more orbits at a fold, and one more at sticking and grazing. Where
    the symmetry is lost, their number is unchanged and det(I + G) changes its sign.
    """
    if b.kind is Kind.unresolved:
        return b
    away = _DISTANCES * (search.high - search.low)
    change = {Kind.fold: 2, Kind.symmetry_breaking: 0}.get(b.kind, 1)
    sides = (_neighbours(search, b, b.value + side * away, max(change, 1)) for side in (-1.0, 1.0))
    # The first distance at which both sides agree with the kind of the bifurcation confirms it.
    for (near, below, margin), (other, above, its_margin) in zip(*sides, strict=True):
        more = near - other
        if abs(more) == change and (change or margin * its_margin < 0):
            none = status_name(Status.no_orbit)
            return replace(b, below=none if more < 0 else below, above=none if more > 0 else above)
    reason = f"a {b.kind.value.replace('_', ' ')} was located, but the orbits on both sides do not show it"
    return replace(b, kind=Kind.unresolved, reason=reason)


def _neighbours(
    search: _Search, b: Bifurcation, values: np.ndarray, several: int
) -> list[tuple[int, str, float]]:
    """Return for other values how many orbits are near a bifurcation, and status and det(I + G) of the
    closest one. The status is rocking if one of the `several` closest orbits has this status."""
    values = np.clip(values, search.low, search.high)
    orbits, names = orbits_at(search.axis, values)
    symmetry = np.asarray(orbits.margins.symmetry)
    at = search.axis.at(np.append(values, b.value))[:, [XI]] / np.pi
    places = np.stack([orbits.crossing * at[:-1], orbits.phase], axis=-1)
    apart = np.abs(wrapped(places - np.array([b.crossing * at[-1, 0], b.phase]))).max(axis=-1)
    # Orbits farther away belong to other branches.
    apart = np.where(apart < _MOST_DISTANCE, apart, np.inf)
    out = []
    for i, order in enumerate(np.argsort(apart, axis=1)):
        close, rocking = [str(names[i, j]) for j in order[:several]], status_name(Status.rocking)
        status = rocking if rocking in close else close[0]
        out.append((int(np.isfinite(apart[i]).sum()), status, float(symmetry[i, order[0]])))
    return out
