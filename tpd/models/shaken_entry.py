"""The entrance to the compiled code of motions under ground motions, for XLA and for the host."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numba.np.numpy_support import carray

from tpd.exact.arc_kernel import COMPLEX_PLANT, PLANT, part, stored
from tpd.models.compiling import checksum
from tpd.models.custom_call import api_version, on_host, pointer, rows_of, table
from tpd.models.shaken_derivatives import INPUTS, PLANTS, ROWS, TIMES, differentiate
from tpd.models.shaken_kernel import LEG, LEGS, OUT, TALLY, follow, put_results, room_for

_PIECE, _STATE, _PARAMETERS, _OUT = map(np.int64, (4, 4, 9, OUT))
"""Columns of further tables; a piece has four coefficients."""
SETTINGS = np.int64(8)
PIECES, FIRST, FREE, REST, MOST, DIRECTIONS, BRIEF, ANGLES = range(8)
"""Numbers in a row of settings, and their columns: pieces of the motion; the row of its first, or -1 if every
motion has its own; free time; rest rate; events allowed; how many directions have derivatives (0, 9 or 13);
whether the free motion may end where it cannot tilt the block further; and whether the derivatives of the
largest angles are enough."""


@part
def _run(a, first, last):
    """Rows of `follow`: settings, parameters, starts and pieces; results and derivatives."""
    s, x, y0, out = (
        table(a[0], last, SETTINGS),
        table(a[1], last, _PARAMETERS),
        table(a[2], last, _STATE),
        table(a[4], last, _OUT),
    )
    plants, others = np.empty(1, PLANT), np.empty(PLANTS, COMPLEX_PLANT)
    tally, mode, y, none = np.empty(TALLY), np.zeros(4), np.empty(4), np.empty((0, LEG))
    for r in range(first, last):
        n, begin, inputs, most = int(s[r, PIECES]), int(s[r, FIRST]), int(s[r, DIRECTIONS]), int(s[r, MOST])
        # XLA gives every motion a copy of its record, the host one place for all.
        begin = r * n if begin < 0 else begin
        c = table(a[3], begin + n, _PIECE)[begin:]
        # Of memory that nothing is written to the system gives none.
        legs = np.empty((room_for(n, most), LEG)) if inputs > 0 else none
        while True:
            for i in range(4):
                y[i], mode[i] = y0[r, i], 0.0
            brief, free, rest = s[r, BRIEF] != 0.0, s[r, FREE], s[r, REST]
            status = follow(x[r], plants[0], c, n, y, free, rest, most, brief, tally, legs, mode)
            if inputs == 0 or tally[LEGS] <= len(legs):
                break
            legs = np.empty((int(tally[LEGS]), LEG))
        put_results(plants[0], n, s[r, FREE], y, mode, tally, status, out[r])
        if inputs > 0:
            # Directions that are not asked for stay zero, and times without a derivative no numbers.
            by = carray(pointer(a[5]), (last, ROWS, INPUTS), np.float64)[r]
            for i in range(ROWS):
                for j in range(INPUTS):
                    by[i, j] = math.nan if i >= TIMES and j < inputs else 0.0
            angles = s[r, ANGLES] != 0.0
            out[r, 10] = differentiate(x[r], plants[0], others, c, n, legs, tally, inputs, angles, by)


def _entrance(version: int, api: int) -> Any:
    def call(address):
        """Answer a frame: 0 for success."""
        a = np.zeros(8, np.int64)
        first, last, by_host = rows_of(address, a, api)
        # One call: Numba compiles all that is called once more for each other kind of argument.
        if last > first:
            _run(a, first, last)
        return version if by_host else 0

    # See `tpd.models.linear_entry`.
    return stored(call, numba.cfunc, "int64(int64)")


CALL = _entrance(checksum("shaken_"), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
