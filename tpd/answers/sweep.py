"""The symmetric period-one orbits as one parameter varies, joined to continuous branches."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from tpd.answers.symmetric_orbits import ORBITS, Margins, Orbits, all_symmetric_orbits
from tpd.core import checks
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import Axis, parameters
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import names_of

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
    stroke: np.ndarray
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


def sweep(subject: Parameters | Scene, name: str, values: Any, *, pendulum: Pendulum | None = None) -> Sweep:
    """All symmetric period-one orbits over increasing `values` of `name`.

    Neighbours are joined to branches where crossing time, phase and amplitude continue and
    det(I - G) keeps its sign, so that no branch runs through a fold. rho follows nu where the subject
    leaves it so.

    Args:
        subject: dimensionless parameters, or a scene; its value of `name` is not used.
        name: one of nu, mu, lam, zeta, k, f, xi, e and rho, the other parameters constant. In a scene
            also width, height, mass, friction, restitution, amplitude, frequency, pendulum_mass,
            pendulum_length or pendulum_damping, the other quantities in SI units constant: a higher
            `frequency` is a larger xi and, at the same amplitude, a larger f.
        values: shape (n,), increasing; in SI units if the name is one of a scene.
        pendulum: in the scene; default none.

    Raises:
        ValueError: an unknown name, batched parameters, or values that do not increase or lie
            outside their range.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    axis = Axis.of(subject, name, pendulum)
    checks.numbers("values", values, (-1,), "two or more numbers that increase")
    grid = np.asarray(values, dtype=float)
    if grid.ndim != 1 or len(grid) < 2 or not (np.all(np.isfinite(grid)) and np.all(np.diff(grid) > 0)):
        raise ValueError("`values` must be two or more finite numbers that increase, but are not")
    axis.check(grid[0], grid[-1])
    return along(axis, grid)


def orbits_at(axis: Axis, values: np.ndarray) -> tuple[Orbits, np.ndarray]:
    """The orbits at any values, as NumPy arrays, and the names of their statuses."""
    orbits = all_symmetric_orbits(parameters(list(axis.at(values).T)))
    return orbits, names_of(orbits.status)


def along(axis: Axis, grid: np.ndarray) -> Sweep:
    """Return the sweep over a grid that has been checked."""
    orbits, names = orbits_at(axis, grid)
    shares = orbits.crossing * axis.at(grid)[:, 6:7] / np.pi
    place = np.stack([shares, orbits.phase, np.log(orbits.amplitude)], axis=-1)
    return Sweep(
        name=axis.name,
        value=grid,
        status=names,
        amplitude=np.asarray(orbits.amplitude),
        stroke=np.asarray(orbits.stroke),
        phase=np.asarray(orbits.phase),
        crossing=np.asarray(orbits.crossing),
        multipliers=np.asarray(orbits.multipliers),
        margins=orbits.margins,
        overflow=np.asarray(orbits.overflow),
        branch=_joined(grid, place, np.sign(orbits.margins.fold)),
    )


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
