"""Batches of motions as rows of plain arrays, for compiled code that follows one after another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from tpd.core import checks
from tpd.exact.rows import row_of
from tpd.exact.terms import XI
from tpd.models.base import Settled
from tpd.models.calling import Compiled
from tpd.models.compiled_linear import EXACT, settled_of
from tpd.models.piecewise import Piecewise
from tpd.scene.parameters import NAMES, Parameters


def _rows_of(p: Parameters, y0: Any, begin: Any, ramp: Any) -> tuple[np.ndarray, ...]:
    """Starts (n, 4), parameters (n, 9), beginnings and ramps (n,)."""
    starts = np.array(y0, dtype=float, order="C")
    n = len(starts) if starts.ndim else 0
    shapes = sorted({np.shape(x) for x in jax.tree.leaves((p, begin, ramp))} - {()})
    if starts.shape != (n, 4) or n == 0 or shapes not in ([], [(n,)]):
        raise ValueError(
            f"`p`, `begin` and `ramp` must have shape (n,) and `y0` (n, 4), but have {shapes} and "
            f"{starts.shape}"
        )
    rows, begins, ramps = np.empty((n, len(NAMES))), np.empty(n), np.empty(n)
    rows[:], begins[:], ramps[:] = row_of(p), begin, ramp
    late = (begins < 0.0) | (begins * rows[:, XI] > 2.0 * np.pi * (1.0 + 1e-12))
    if np.any(late | ~np.isfinite(begins)):
        raise ValueError(f"`begin` must lie within the first forcing period, but is {begins[late]}")
    checks.not_negative("ramp", ramps, every=True)
    return starts, rows, begins, ramps


def settle_rows(
    compiled: Compiled,
    motions: tuple[Parameters, Any, Any, Any],
    workers: int | None,
    progress: Callable[[int, int], None] | None,
    **limits: Any,
) -> Settled:
    """Follow motions (parameters, starts, beginnings and ramps), as `settle_all` has them,
    until each repeats, rests or is lost; `limits` are settings of the compiled code."""
    checks.require_x64()
    starts, rows, begins, ramps = _rows_of(*motions)
    # Loaded here, and not with the package: it loads Numba.
    entry = compiled.entry()
    n, times = len(starts), np.stack([begins, ramps], axis=1)
    found = np.empty(n, entry.SETTLED)
    row = tuple(entry.settings(task=entry.SETTLE, **limits))
    settings = np.full(n, np.array(row, entry.SETTINGS))
    compiled.in_threads(n, workers, progress, settings, rows, starts, times, found)
    return settled_of(found.view(float).reshape(n, -1), entry.SETTLED)


def settle_all(
    p: Parameters,
    y0: Any,
    *,
    begin: Any = 0.0,
    ramp: Any = 0.0,
    model: Piecewise | None = None,
    workers: checks.Whole | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Settled:
    """`model.settle` of every element of a batch, in bounded memory and on all cores.

    Args:
        p: parameters, of shape (n,) or single numbers for all.
        y0: starts, shape (n, 4).
        begin: dimensionless times at which the shaking and the motion begin, within the first forcing
            period; shape (n,) or one for all. The default is tau = 0.
        ramp: forcing periods over which the shaking grows linearly to its full size, counted from tau = 0
            also for motions that begin later; shape (n,) or one for all. The default is sudden.
        model: default `Piecewise()`; its `max_periods` bounds each motion.
        workers: threads; default the number of cores.
        progress: called with (motions done, of how many) now and then.

    Returns:
        A `Settled` with NumPy leaves of leading axis n, in the order of the batch.

    Raises:
        ValueError: an empty batch, leaves of different lengths, a number out of range, or workers below one.
        RuntimeError: JAX is in 32-bit mode.
    """
    model = Piecewise() if model is None else model
    limits = {"periods": model.max_periods, "events": model.max_events, "tolerance": model.tolerance}
    motions = p, y0, begin, ramp
    return settle_rows(EXACT, motions, workers, progress, rest_rate=model.rest_rate, **limits)
