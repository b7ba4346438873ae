"""Symmetric period-one orbits by compiled scalar code: batches on the host, one call under XLA.

Parameters are rows (nu, mu, lam, zeta, k, f, xi, rho, e) with inertia and velocity ratios of their own, as in
`tpd.models.compiled_linear`. An orbit is a record with the fields of
`tpd.exact.symmetric_orbit_kernel.ORBIT`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from tpd.core import checks
from tpd.core.orbit_terms import STATUSES
from tpd.core.parameters import Parameters
from tpd.models.calling import Compiled, shape
from tpd.models.rows import shared

_PIECE = 16, 256
"""Designs of one piece of work, at least and at most: each takes some 10 µs, and a thread is not worth
less."""


class Asked(NamedTuple):
    """Sizes whose derivatives are asked for, beside those of amplitude, phase and crossing."""

    stroke: bool = False
    margins: bool = False
    state: bool = False


_NOTHING = Asked()


def load() -> Any:
    """The module with the compiled code, which is compiled where there is none on this machine."""
    return _CODE.entry()


def _trial(entry: Any) -> tuple[tuple[jax.ShapeDtypeStruct, ...], tuple[np.ndarray, ...]]:
    """A way from turn to turn: of an orbit, places that mean nothing are left as they were."""
    x = np.array([0.25, 0.1, 0.6, 0.1, 0.05, 0.4, 2.0, 0.7, 0.9])
    return (shape(entry.SURVEYED),), (_settings(entry.SURVEY), x, np.array([0.7, 0.3, 0.0]))


_CODE = Compiled("tpd.models.orbit_entry", "tpd_symmetric_orbits", "symmetric orbits", _trial)


def row_of(p: Parameters) -> Any:
    """Parameters as the compiled code takes them: the last axis of an array, of NumPy's where all are
    known."""
    numbers = (p.nu, p.mu, p.lam, p.zeta, p.k, p.f, p.xi, p.inertia_ratio, p.velocity_ratio)
    library = checks.namespace(*numbers)
    return library.stack(
        library.broadcast_arrays(*(library.asarray(x, dtype=float) for x in numbers)), axis=-1
    )


def _settings(what: int, directions: int = 0, asked: Asked = _NOTHING) -> np.ndarray:
    return np.array([what, directions, *asked], dtype=float)


def _spread(row: np.ndarray, n: int) -> np.ndarray:
    return np.ascontiguousarray(np.broadcast_to(row, (n, *row.shape)))


def solve_all(
    x: np.ndarray, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> np.ndarray:
    """Orbits of the designs `x` (n, 9), on all cores: records (n, 3), the largest first.

    Raises:
        ValueError: workers below one.
    """
    entry, x, n = load(), np.ascontiguousarray(x, dtype=float), len(x)
    settings, orbits = _spread(_settings(entry.SOLVE), n), np.empty((n, int(entry.ORBITS)), entry.ORBIT)

    def run(first: int, last: int) -> int:
        entry.run(first, last, settings, x, orbits)
        return last - first

    shared(run, n, workers, progress, piece=_PIECE)
    return orbits


def slopes_all(
    x: np.ndarray, orbits: np.ndarray, directions: np.ndarray, asked: Asked, *, workers: int | None = None
) -> np.ndarray:
    """Derivatives of the sizes of orbits (n, m) of designs `x` (n, 9) in `directions` (n, d, 9), an array
    (n, m, d, sizes): NaN where there is none, or it is not asked for."""
    entry, (n, d) = load(), directions.shape[:2]
    # The kernel takes all orbits of a design: where none is asked for, the status says that there is none.
    every: Any = np.zeros((n, int(entry.ORBITS)), entry.ORBIT)
    every["status"] = STATUSES.index("no_orbit")
    every[:, : orbits.shape[1]] = orbits
    x, along = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(directions, dtype=float)
    settings = _spread(_settings(entry.DIFFERENTIATE, d, asked), n)
    slopes = np.empty((*every.shape, d, int(entry.NUMBERS)))

    def run(first: int, last: int) -> int:
        entry.run(first, last, settings, x, every, along, slopes)
        return last - first

    shared(run, n, workers, None, piece=_PIECE)
    return slopes[:, : orbits.shape[1]]


def solved(x: Any) -> Any:
    """Orbits of the design `x` (9,), known or traced, as numbers (3, numbers of an orbit)."""
    if checks.is_concrete(x):
        orbits = solve_all(np.asarray(x)[None], workers=1)
        return orbits.view(np.float64).reshape(orbits.shape[1], -1)
    entry = load()
    return _CODE((shape(entry.ORBITS, entry.ORBIT.itemsize // 8),), _settings(entry.SOLVE), x)[0]


def slopes(x: Any, orbits: Any, asked: Asked) -> Any:
    """Derivatives in all nine parameters of the sizes of the orbits that `solved` has given, (3, 9,
    sizes)."""
    entry, along = load(), np.eye(9)
    if checks.is_concrete(x) and checks.is_concrete(orbits):
        known = np.ascontiguousarray(orbits).view(entry.ORBIT)[:, 0]
        return slopes_all(np.asarray(x)[None], known[None], along[None], asked, workers=1)[0]
    settings = _settings(entry.DIFFERENTIATE, len(along), asked)
    return _CODE((shape(entry.ORBITS, len(along), entry.NUMBERS),), settings, x, orbits, along)[0]


class Vanishing(NamedTuple):
    """Functions of u = (t, gamma, s) and of the parameters that vanish where orbits are lost."""

    values: np.ndarray
    """phi'(0), phi(t), the determinant of the derivatives of both in (t, gamma), det(I + G), phi''(0+),
    phi'(s) and phi''(s), (7,); see `tpd.exact.symmetric_orbit_kernel.vanishing`."""
    by_u: np.ndarray
    """(7, 3)"""
    by_x: np.ndarray
    """(7, 9)"""


def vanishing(u: np.ndarray, x: np.ndarray) -> Vanishing:
    """Numbers that vanish where orbits are lost, at u = (t, gamma, s) and the parameters `x`."""
    entry = load()
    values, by = np.empty((1, int(entry.VANISHING))), np.empty((1, int(entry.VANISHING), int(entry.MOVED)))
    entry.run(0, 1, _settings(entry.VANISH)[None], _wide(x), _wide(u), values, by)
    return Vanishing(values[0], by[0, :, :3], by[0, :, 3:])


class Survey(NamedTuple):
    """Extremes of a solution (t, gamma) of the conditions between its turns. It is an orbit if height > 0 and
    all the others are < 0."""

    height: float
    """phi at the turn."""
    leaving: float
    """phi'' just after it."""
    arriving: float
    """-phi'' just before the next turn."""
    rates: np.ndarray
    """phi' at equal steps between them, (199,)."""


def survey(u: np.ndarray, x: np.ndarray) -> Survey:
    """The way of the solution u = (t, gamma) with the parameters `x`, from turn to turn."""
    entry, out = load(), np.empty((1, int(load().SURVEYED)))
    entry.run(0, 1, _settings(entry.SURVEY)[None], _wide(x), _wide(np.append(u, 0.0)), out)
    return Survey(float(out[0, 0]), float(out[0, 1]), float(out[0, 2]), out[0, 3:])


def _wide(x: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(x, dtype=float)[None]
