"""Symmetric orbits of many scenes with their derivatives, by one compiled program."""

from __future__ import annotations

import functools
from collections import namedtuple
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tests.reference import NAMES, parameters
from tests.truth import load
from tpd import symmetric_orbits
from tpd.core.batch import in_chunks
from tpd.scene.status import names_of

BATCH = 64
"""Of everything computed here, so that one compilation serves all tests."""
ROWS = [row for row in load("harmonic") if row["what"] == "orbits"]
"""All orbits of scenes, by a scan and 50 digits."""
_SIZES = "status amplitude swing state phase crossing multipliers fold symmetry remaining sticking grazing"


class Answers(namedtuple("Answers", f"{_SIZES} slopes overflow")):
    """NumPy arrays with leading axes (scenes, orbits). Statuses are names; `slopes` are d(amplitude, stroke,
    state, phase, crossing, fold, symmetry, remaining)/d(parameters), shape (scenes, orbits, 11, 8)."""

    @property
    def exists(self) -> np.ndarray:
        """Where there is an orbit."""
        return self.status != "no_orbit"


def _solve(x: jax.Array) -> tuple:
    def sizes(x: jax.Array) -> tuple:
        o = symmetric_orbits(parameters(x))
        m, many = o.margins, o.multipliers
        numbers = (o.amplitude, o.swing, *o.state.T, o.phase, o.crossing, m.fold, m.symmetry, o.remaining)
        unknown = (m.sticking, m.grazing, *many.real.T, *many.imag.T)
        return (jnp.stack(numbers, axis=1), jnp.stack(unknown, axis=1)), o

    return jax.jacfwd(sizes, has_aux=True)(x)


def full(x: Any) -> np.ndarray:
    """A vector of eight parameters; e = 1 unless given."""
    out = np.ones(8)
    out[: len(x)] = x
    return out


def solve(xs: Any) -> Answers:
    """`symmetric_orbits` of many scenes, with its derivatives."""
    points = np.stack([full(x) for x in xs])
    (slopes, unknown), o = in_chunks(_solve, points, chunk=BATCH)
    assert np.all(np.isnan(unknown))
    m = o.margins
    sizes = (o.amplitude, o.swing, o.state, o.phase, o.crossing, o.multipliers)
    sizes = (*sizes, m.fold, m.symmetry, o.remaining, m.sticking, m.grazing)
    return Answers(names_of(o.status), *sizes, slopes, o.overflow)


def among(x: tuple, name: str, values: np.ndarray) -> Answers:
    """The answers while one parameter takes some values."""
    xs = np.tile(full(x), (len(values), 1))
    xs[:, NAMES.index(name)] = values
    return solve(xs)


@functools.cache
def scanned() -> tuple[np.ndarray, Answers]:
    """The scenes of the table, and their orbits."""
    xs = np.array([row["parameters"] for row in ROWS])
    return xs, solve(xs)


def chosen(count: int, kind: str) -> list[tuple[np.ndarray, Answers]]:
    """The first so many scenes of the table with an orbit of a status, and that orbit."""
    xs, all_of = scanned()
    found = []
    for i, j in zip(*np.nonzero(all_of.status == kind), strict=True):
        found.append((xs[i], Answers(*(a[i] if a.ndim == 1 else a[i, j] for a in all_of))))
    assert len(found) >= count
    return found[:count]


def felt(x: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """The derivative of the return map, of what is felt: a bob without mass is not."""
    return slopes if x[1] > 0 else slopes * np.outer([1, 0, 1, 0], [1, 0, 1, 0])
