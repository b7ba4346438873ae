"""Following many motions of the linear equations at once, on all cores."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.parameters import Parameters
from tpd.models import compiling
from tpd.models.base import Settled
from tpd.models.piecewise import Piecewise
from tpd.models.rows import rows_of, settled_of, shared


def settle_all(
    p: Parameters,
    y0: Any,
    *,
    begin: Any = 0.0,
    ramp: Any = 0.0,
    model: Piecewise | None = None,
    workers: int | None = None,
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
    checks.require_x64()
    model = Piecewise() if model is None else model
    starts, rows, begins, ramps = rows_of(p, y0, begin, ramp)
    # Loaded here, and not with the package: it loads Numba.
    compiling.load("tpd.models.exact_entry")
    from tpd.exact.repetition import STATUSES
    from tpd.models import exact_entry as entry

    n = len(starts)
    floats, counts = np.empty((n, entry.FLOATS)), np.empty((n, entry.WHOLES))
    settings: Any = np.zeros(n, entry.SETTINGS)
    settings["task"], settings["periods"], settings["events"] = (
        entry.SETTLE,
        model.max_periods,
        model.max_events,
    )
    settings["tolerance"], settings["rest_rate"] = model.tolerance, model.rest_rate
    times = np.stack([begins, ramps], axis=1)

    def run(first: int, last: int) -> int:
        entry.run(first, last, settings, rows, starts, times, floats, counts)
        return last - first

    shared(run, n, workers, progress)
    return settled_of(floats, counts.astype(np.int64), STATUSES)
