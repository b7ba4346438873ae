"""The entrance to the compiled code of symmetric orbits, for XLA and for the host."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from tpd.core.machine_code import stored
from tpd.exact.compiling import checksum
from tpd.exact.custom_call import api_version, at, on_host, places_in, rows_of
from tpd.exact.motion import FIRST_PIECE
from tpd.exact.plant import part
from tpd.exact.symmetric_orbit_kernel import (
    MOVED,
    NUMBERS,
    ORBIT,
    ORBITS,
    SURVEYED,
    VANISHING,
    WORK,
    differentiate,
    solve,
    survey,
    vanishing,
)
from tpd.exact.terms import MANY

SOLVE, DIFFERENTIATE, VANISH, SURVEY = range(4)
"""Tasks."""
SETTINGS = np.dtype([(name, np.float64) for name in ("task", "directions", "begin", "end")])
"""A row of settings: the task; for derivatives the number of directions, and the range of sizes that are
asked for."""


@part
def _run(a, first, last):
    """Rows of a task, each with its settings and parameters. The others are, operands first: orbits of
    `solve`; orbits, directions and slopes of `differentiate`; (t, gamma, s), numbers and derivatives of
    `vanishing`; the same and numbers of `survey`."""
    settings, design, third, fourth, fifth, _, _, _ = places_in(a)
    s, x, memory = at(settings, (last,), SETTINGS), at(design, (last, MANY), np.float64), np.empty(1, WORK)
    what, count, work = s[first].task, int(s[first].directions), memory[FIRST_PIECE]
    if what == SOLVE:
        orbits = at(third, (last, ORBITS), ORBIT)
        for n in range(first, last):
            solve(x[n], work, orbits[n])
    elif what == DIFFERENTIATE:
        orbits, along = at(third, (last, ORBITS), ORBIT), at(fourth, (last, count, MANY), np.float64)
        slopes = at(fifth, (last, ORBITS, count, NUMBERS), np.float64)
        for n in range(first, last):
            differentiate(x[n], orbits[n], along[n], int(s[n].begin), int(s[n].end), work, slopes[n])
    elif what == VANISH:
        u, out = at(third, (last, 3), np.float64), at(fourth, (last, VANISHING), np.float64)
        by = at(fifth, (last, VANISHING, MOVED), np.float64)
        for n in range(first, last):
            vanishing(x[n], u[n], work, out[n], by[n])
    else:
        u, out = at(third, (last, 3), np.float64), at(fourth, (last,), SURVEYED)
        for n in range(first, last):
            survey(x[n], u[n], work, out[n])
    # A record does not keep its memory, and Numba frees an array after its last use.
    return len(memory)


def _entrance(version: int, api: int) -> Any:
    def call(address):
        """Answer a frame: 0 for success."""
        a = np.zeros(8, np.int64)
        first, last, by_host = rows_of(address, a, api)
        if last > first:
            _run(a, first, last)
        return version if by_host else 0

    # Numbers from outside the function are part of the key of Numba's store, see `linear_entry`.
    return stored(call, numba.cfunc, "int64(int64)")


CALL = _entrance(checksum(), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
