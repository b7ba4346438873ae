"""Entry point to the compiled code of symmetric orbits, for XLA and for Python."""

from __future__ import annotations

import numpy as np

from tpd.compiled.columns import WIDTH
from tpd.compiled.custom_call import addresses_in, entrance, on_host, view
from tpd.compiled.plant import ONLY
from tpd.compiled.symmetric_orbit_kernel import (
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

SOLVE, DIFFERENTIATE, VANISH, SAMPLE_PATH = range(4)
"""Tasks, which are the first number of every row of settings."""
SETTINGS = np.dtype([(name, np.float64) for name in ("task", "directions", "begin", "end")])
"""A row of settings: the task, and for derivatives the number of directions and the range of the sizes to
compute."""


def _run(a, first, last):
    """Compute rows of a task. Each row has its settings and its parameters.

    The other buffers, operands first, are: for `solve` the orbits; for `differentiate` orbits, directions and
    slopes; for `vanishing` (t, gamma, s), the numbers and their derivatives; for `sample_path` (t, gamma, s)
    and the samples.
    """
    settings, design, third, fourth, fifth, _, _, _ = addresses_in(a)
    s = view(settings, (last,), SETTINGS)
    x, works = view(design, (last, WIDTH), np.float64), np.zeros(1, WORK)
    task, count, work = s[first].task, int(s[first].directions), works[ONLY]
    if task == SOLVE:
        orbits = view(third, (last, ORBITS), ORBIT)
        for n in range(first, last):
            solve(x[n], work, orbits[n])
    elif task == DIFFERENTIATE:
        orbits, along = view(third, (last, ORBITS), ORBIT), view(fourth, (last, count, WIDTH), np.float64)
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
    # A record does not keep its array alive, and Numba frees an array after its last use.
    return len(works)


CALL = entrance(_run)
"""The entry point, an FFI handler for XLA."""
run = on_host(CALL)
"""Function for calls from Python. The arguments are the first row, the row after the last, then operands and
results."""
