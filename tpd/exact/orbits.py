"""Symmetric period-one orbits by compiled scalar code: batches on the host, one call under XLA.

Parameters are rows, see `tpd.exact.rows.row_of`. An orbit is a record with the fields of
`tpd.exact.symmetric_orbit_kernel.ORBIT`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.exact.calling import ORBITS, numbers_in, parts, shape
from tpd.exact.terms import STATUSES
from tpd.scene.parameters import NAMES

_PIECE = 16, 256
"""Designs of one piece of work, at least and at most: each takes some 10 µs, and a thread is not worth
less."""


def _settings(task: str, directions: int = 0, asked: tuple[int, int] = (0, 0)) -> np.ndarray:
    begin, end = asked
    return np.array(ORBITS.settings(task, directions=directions, begin=begin, end=end), dtype=float)


def _on_all_cores(
    settings: np.ndarray, workers: int | None, progress: Callable[[int, int], None] | None, *rows: np.ndarray
) -> None:
    x, *_ = rows
    settings = np.ascontiguousarray(np.broadcast_to(settings, (len(x), len(settings))))
    ORBITS.in_threads(len(x), workers, progress, settings, *rows, piece=_PIECE)


def solve_orbits(
    x: np.ndarray, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> np.ndarray:
    """Orbits of the designs `x` (n, 9), on all cores: records (n, 3), the largest first.

    Raises:
        ValueError: workers below one, or no batch.
    """
    if x.ndim != 2 or not len(x):
        raise ValueError(f"numbers of `p` must have shape (n,), but the batch has shape {x.shape[:-1]}")
    orbits = np.empty((len(x), int(ORBITS.entry().ORBITS)), ORBITS.entry().ORBIT)
    _on_all_cores(_settings("SOLVE"), workers, progress, np.ascontiguousarray(x, dtype=float), orbits)
    return orbits


def orbit_slopes(
    x: np.ndarray, orbits: np.ndarray, directions: np.ndarray, asked: tuple[int, int]
) -> np.ndarray:
    """Derivatives of the sizes of orbits (n, m) of designs `x` (n, 9) in `directions` (n, d, 9), an array
    (n, m, d, sizes): NaN where there is none, or it is outside of the range of places that is `asked` for."""
    entry, (n, d) = ORBITS.entry(), directions.shape[:2]
    # The kernel takes all orbits of a design: where none is asked for, the status says that there is none.
    all_orbits: Any = np.zeros((n, int(entry.ORBITS)), entry.ORBIT)
    all_orbits["status"] = STATUSES.index("no_orbit")
    _, m = orbits.shape
    all_orbits[:, :m] = orbits
    x, along = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(directions, dtype=float)
    slopes = np.empty((*all_orbits.shape, d, int(entry.NUMBERS)))
    _on_all_cores(_settings("DIFFERENTIATE", d, asked), None, None, x, all_orbits, along, slopes)
    return slopes[:, :m]


def solved(x: Any) -> Any:
    """Orbits of the design `x` (9,), known or traced, as numbers (3, numbers of an orbit)."""
    entry, call = ORBITS.entry(), ORBITS.on_host if checks.is_concrete(x) else ORBITS
    (out,) = call((shape(entry.ORBITS, numbers_in(entry.ORBIT)),), _settings("SOLVE"), x)
    return out


def slopes(x: Any, orbits: Any, asked: tuple[int, int]) -> Any:
    """Derivatives in all nine parameters of the sizes of the orbits that `solved` has given, (3, 9, sizes),
    see `orbit_slopes`."""
    entry, n = ORBITS.entry(), len(NAMES)
    call = ORBITS.on_host if checks.namespace(x, orbits) is np else ORBITS
    settings = _settings("DIFFERENTIATE", n, asked)
    (out,) = call((shape(entry.ORBITS, n, entry.NUMBERS),), settings, x, orbits, np.eye(n))
    return out


class Vanishing(NamedTuple):
    """Functions of u = (t, gamma, s) and of the parameters that vanish where orbits are lost."""

    values: np.ndarray
    """phi'(0), phi(t), the determinant of the derivatives of both in (t, gamma), det(I + G), phi''(0+),
    phi'(s) and phi''(s), without friction phi(s) and phi'(s), (7,); see
    `tpd.exact.symmetric_orbit_kernel.vanishing`."""
    by_u: np.ndarray
    """(7, 3)"""
    by_x: np.ndarray
    """(7, 9)"""


def vanishing(u: np.ndarray, x: np.ndarray) -> Vanishing:
    """Numbers that vanish where orbits are lost, at u = (t, gamma, s) and the parameters `x`."""
    entry = ORBITS.entry()
    shapes = shape(entry.VANISHING), shape(entry.VANISHING, entry.MOVED)
    values, by = ORBITS.on_host(shapes, _settings("VANISH"), x, u)
    return Vanishing(values, by[:, :3], by[:, 3:])


class PathSamples(NamedTuple):
    """Extremes of a solution (t, gamma) of the conditions between its turns. It is an orbit if height > 0 and
    all the others are < 0."""

    height: float
    """phi at the turn."""
    leaving: float
    """phi'' just after it."""
    arriving: float
    """-phi'' just before the next turn."""
    rates: np.ndarray
    """phi' at equal steps between them, (199,); without friction minus the distance of phi from zero, on its
    side."""


def sample_path(u: np.ndarray, x: np.ndarray) -> PathSamples:
    """The way of the solution u = (t, gamma) with the parameters `x`, from turn to turn."""
    record = ORBITS.entry().PATH_SAMPLES
    (out,) = ORBITS.on_host((shape(numbers_in(record)),), _settings("SAMPLE_PATH"), x, np.append(u, 0.0))
    fields = parts(out, record)
    return PathSamples(float(fields.height), float(fields.leaving), float(fields.arriving), fields.rates)
