"""The entrance to the compiled code of symmetric orbits, for XLA and for the host."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from tpd.core.machine_code import stored
from tpd.exact.compiling import checksum
from tpd.exact.custom_call import addresses_in, api_version, on_host, rows_of, view
from tpd.exact.motion import FIRST_PIECE
from tpd.exact.plant import part
from tpd.exact.symmetric_orbit_kernel import (
    MOVED,
    NUMBERS,
    ORBIT,
    ORBITS,
    PATH_SAMPLES,
    VANISHING,
    WORK,
    differentiate,
    sample_path,
    solve,
    vanishing,
)
from tpd.exact.terms import MANY

SOLVE, DIFFERENTIATE, VANISH, SAMPLE_PATH = range(4)
"""Tasks."""
SETTINGS = np.dtype([(name, np.float64) for name in ("task", "directions", "begin", "end")])
"""A row of settings: the task; for derivatives the number of directions, and the range of sizes that are
asked for."""


@part
def _run(a, first, last):
    """Rows of a task, each with its settings and parameters. The others are, operands first: orbits of
    `solve`; orbits, directions and slopes of `differentiate`; (t, gamma, s), numbers and derivatives of
    `vanishing`; the same and numbers of `survey`."""
    settings, design, third, fourth, fifth, _, _, _ = addresses_in(a)
    s = view(settings, (last,), SETTINGS)
    x, workspaces = view(design, (last, MANY), np.float64), np.empty(1, WORK)
    task, count, work = s[first].task, int(s[first].directions), workspaces[FIRST_PIECE]
    if task == SOLVE:
        orbits = view(third, (last, ORBITS), ORBIT)
        for n in range(first, last):
            solve(x[n], work, orbits[n])
    elif task == DIFFERENTIATE:
        orbits, along = view(third, (last, ORBITS), ORBIT), view(fourth, (last, count, MANY), np.float64)
        slopes = view(fifth, (last, ORBITS, count, NUMBERS), np.float64)
        for n in range(first, last):
            differentiate(x[n], orbits[n], along[n], int(s[n].begin), int(s[n].end), work, slopes[n])
    elif task == VANISH:
        u, out = view(third, (last, 3), np.float64), view(fourth, (last, VANISHING), np.float64)
        by = view(fifth, (last, VANISHING, MOVED), np.float64)
        for n in range(first, last):
            vanishing(x[n], u[n], work, out[n], by[n])
    else:
        u, out = view(third, (last, 3), np.float64), view(fourth, (last,), PATH_SAMPLES)
        for n in range(first, last):
            sample_path(x[n], u[n], work, out[n])
    # A record does not keep its memory, and Numba frees an array after its last use.
    return len(workspaces)


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
