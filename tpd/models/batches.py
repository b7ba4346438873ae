"""Following many motions of the linear equations at once, on all cores."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tpd.models.base import Settled
from tpd.models.compiled_linear import EXACT
from tpd.models.piecewise import Piecewise
from tpd.models.rows import settle_rows
from tpd.scene.parameters import Parameters


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
    model = Piecewise() if model is None else model
    limits = {"periods": model.max_periods, "events": model.max_events, "tolerance": model.tolerance}
    motions = p, y0, begin, ramp
    return settle_rows(EXACT, motions, workers, progress, rest_rate=model.rest_rate, **limits)
