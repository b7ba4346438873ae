"""The motion of the base, piece by piece, for real and for complex numbers.

A piece of a harmonic is one forcing period. All of them are equal, and their number is unlimited. A piece of
a pulse or a record is a cubic in time. A record is linear between its samples, so that its pieces are exact.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.compiled.plant import compiled

YES, NO, FIRST_PIECE = np.bool_(True), np.bool_(False), np.int64(0)
"""NumPy scalars for constants. Numba treats each plain Python constant as another type and would compile a
function once more for each of them."""

Forcing = namedtuple("Forcing", "harmonic share rate pieces cubics")
"""The forcing eta (minus the base acceleration over g), divided by its size f in the plant.

If `harmonic`, eta is (share + rate t) sin(xi t) in every piece, with t from the start of the piece. Otherwise
there are `pieces` cubics, and no forcing after the last one. Row i of `cubics` has the coefficients of piece
i, for powers of the time divided by the duration of the piece, which is xi of the plant.
"""
Load = namedtuple("Load", "xi phase e0 e1 e2 e3")
"""The forcing from an instant on: (e0 + e1 t) sin(phase + xi t), or e0 + e1 t + e2 t^2 + e3 t^3 if xi
is 0."""


@compiled
def harmonic():
    """Return a harmonic forcing of full size."""
    return Forcing(YES, 1.0, 0.0, FIRST_PIECE, np.empty((0, 4)))


@compiled
def span_of(q, f):
    """Return the duration of a piece (tau)."""
    return 2.0 * np.pi / q.xi if f.harmonic else q.xi + 0.0


@compiled
def load_at(q, f, i, s):
    """Return the forcing from the local time `s` of piece i on."""
    h, zero = q.xi, 0.0 * (q.xi * s)
    # Numba must see the same type of number in all branches.
    if f.harmonic:
        return Load(h + zero, h * s, f.share + f.rate * s + zero, f.rate + zero, zero, zero)
    if i >= f.pieces:
        return Load(zero, zero, zero, zero, zero, zero)
    c0, c1, c2, c3 = f.cubics[i]
    # The coefficients of the piece for powers of the time, moved to the local time s.
    a, b, g = c1 / h, c2 / (h * h), c3 / (h * h * h)
    e0, e1 = c0 + s * (a + s * (b + s * g)), a + s * (2.0 * b + 3.0 * s * g)
    return Load(zero, zero, e0, e1, b + 3.0 * s * g, g + zero)


@compiled
def forcing_now(q, f, i, s):
    """Return eta at the local time `s` of piece i."""
    e = load_at(q, f, i, s)
    return e.e0 * np.sin(e.phase) if e.xi != 0.0 else e.e0
