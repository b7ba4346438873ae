"""Symmetric period-one orbits: batches of designs in Python, and one design in JAX programs.

Parameters are rows, see `tpd.compiled.rows.row_of`. An orbit is a record with the fields of
`tpd.compiled.symmetric_orbit_kernel.ORBIT`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tpd.compiled.calling import ORBITS, check_width, parts, shape
from tpd.compiled.columns import NO_ORBIT
from tpd.core import checks
from tpd.scene.parameters import NAMES

_PIECE = 16, 256
"""Smallest and largest number of designs in one piece of work. A design takes about 10 µs, so that fewer
designs are not worth a thread."""


def _settings(task: str, directions: int = 0, begin: int = 0, end: int = 0) -> np.ndarray:
    """Return a row of settings."""
    return np.array(ORBITS.settings(task, directions=directions, begin=begin, end=end), dtype=float)


def _on_all_cores(
    settings: np.ndarray, workers: int | None, progress: Callable[..., Any] | None, x: np.ndarray, *rows: Any
) -> None:
    """Compute rows of a task in several threads. `x` has the parameters, and `rows` the other buffers."""
    settings = np.ascontiguousarray(np.broadcast_to(settings, (len(x), len(settings))))
    ORBITS.in_threads(len(x), workers, progress, settings, x, *rows, piece=_PIECE)


def solve_orbits(
    x: np.ndarray, *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> np.ndarray:
    """Return the symmetric orbits of many designs.

    Args:
        x: parameters of the designs, shape (n, 10).
        workers: number of threads, by default one for each core.
        progress: function that is called from time to time with (designs done, number of designs).

    Returns:
        Records of shape (n, 3), the orbit with the largest amplitude first.

    Raises:
        ValueError: `workers` is less than one, or `x` is not a batch.
    """
    if x.ndim != 2 or not len(x):
        raise ValueError(f"numbers of `p` must have shape (n,), but the batch has shape {x.shape[:-1]}")
    orbits = np.empty((len(x), int(ORBITS.entry().ORBITS)), ORBITS.entry().ORBIT)
    _on_all_cores(_settings("SOLVE"), workers, progress, np.ascontiguousarray(x, dtype=float), orbits)
    return orbits


def orbit_slopes(
    x: np.ndarray, orbits: np.ndarray, directions: np.ndarray, group: tuple[int, int]
) -> np.ndarray:
    """Return the derivatives of the sizes of orbits (n, m) of many designs `x` (n, 10).

    The derivatives are those in `directions` (n, d, 10) of the parameters.

    The result has shape (n, m, d, sizes). Derivatives that do not exist are NaN, and so are those of sizes
    outside of the `group` (first index, index after the last).
    """
    check_width(directions)
    entry, (n, d) = ORBITS.entry(), directions.shape[:2]
    # The kernel takes all three orbits of a design. Places without an orbit get the status `no_orbit`.
    all_orbits: Any = np.zeros((n, int(entry.ORBITS)), entry.ORBIT)
    all_orbits["status"] = NO_ORBIT
    _, m = orbits.shape
    all_orbits[:, :m] = orbits
    x, along = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(directions, dtype=float)
    slopes = np.empty((*all_orbits.shape, d, int(entry.NUMBERS)))
    _on_all_cores(_settings("DIFFERENTIATE", d, *group), None, None, x, all_orbits, along, slopes)
    return slopes[:, :m]


def solved(x: Any) -> Any:
    """Return the orbits of the design `x` (10,), which JAX may trace, as numbers of shape (3, n)."""
    entry, call = ORBITS.entry(), ORBITS.on_host if checks.is_concrete(x) else ORBITS
    (out,) = call((shape(entry.ORBITS, entry.ORBIT),), _settings("SOLVE"), x)
    return out


def slopes(x: Any, orbits: Any, group: tuple[int, int]) -> Any:
    """Return the derivatives of the sizes of the orbits from `solved` in all parameters.

    The result has shape (3, 10, sizes).

    `group` is the group of sizes, see `orbit_slopes`.
    """
    entry, n = ORBITS.entry(), len(NAMES)
    call = ORBITS.on_host if checks.namespace(x, orbits) is np else ORBITS
    settings = _settings("DIFFERENTIATE", n, *group)
    (out,) = call((shape(entry.ORBITS, n, entry.NUMBERS),), settings, x, orbits, np.eye(n))
    return out


class Vanishing(NamedTuple):
    """Functions of u = (t, gamma, s) and of the parameters that vanish where orbits are lost."""

    values: np.ndarray
    """phi'(0), phi(t), the determinant of their derivatives in (t, gamma), det(I + G), phi''(0+), phi'(s) and
    phi''(s), without friction phi(s) and phi'(s), shape (7,). See
    `tpd.compiled.symmetric_orbit_kernel.vanishing`."""
    by_u: np.ndarray
    """Derivatives in u, shape (7, 3)."""
    by_x: np.ndarray
    """Derivatives in the parameters, shape (7, 10)."""


def vanishing(u: np.ndarray, x: np.ndarray) -> Vanishing:
    """Return the functions that vanish where orbits are lost, at u = (t, gamma, s) and the parameters `x`."""
    entry = ORBITS.entry()
    shapes = shape(entry.VANISHING), shape(entry.VANISHING, entry.MOVED)
    values, by = ORBITS.on_host(shapes, _settings("VANISH"), x, u)
    return Vanishing(values, by[:, :3], by[:, 3:])


def sample_path(u: np.ndarray, x: np.ndarray) -> Any:
    """Return samples along the path of the solution u = (t, gamma) with the parameters `x`.

    The attributes of the result are those of `tpd.compiled.symmetric_orbit_kernel.PATH_SAMPLES`. The solution
    is an orbit if `height` is positive and all other numbers are negative.
    """
    record = ORBITS.entry().PATH_SAMPLES
    (out,) = ORBITS.on_host((shape(record),), _settings("SAMPLE_PATH"), x, np.append(u, 0.0))
    return parts(out, record)
